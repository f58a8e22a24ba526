"""One frame of a scene as one picture: cameras, the front camera's other modalities, lidar and labels from above."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from simbev_ros.types import AnyArray, UInt8Array
from simbev_ros.viz import panels
from simbev_ros.viz.canvas import ACCENT, BACKGROUND, BOLD, DIM, LINE, SURFACE, draw_label, draw_picture, draw_text
from simbev_ros.viz.frames import Frame, Views
from simbev_ros.viz.layout import Block, Box, Column, Row, Tile, place_in_width

DESIGN_WIDTH_PX = 1920
"""All lengths below are for this width and scale with it."""

_MARGIN, _GAP, _HEADER, _RADIUS = 24, 10, 78, 7

_Paint = Callable[[Mapping[str, AnyArray], Box], UInt8Array]


@dataclass(frozen=True, slots=True)
class Captions:
    """The words on a sheet.

    Attributes:
        title: The scene.
        facts: What it is like, in a line.
        frames: How many frames it has.
        start_ns: Stamp from which time is counted.
    """

    title: str
    facts: str
    frames: int
    start_ns: int


@dataclass(frozen=True, slots=True)
class _Panel:
    """The place of some topics, named by the first of them: its words, and how it is made from a frame's arrays."""

    topics: Sequence[str]
    title: str
    note: str
    paint: _Paint


class ContactSheet:
    """The layout for one bag, drawn again for each frame.

    Attributes:
        size_px: Width and height of the sheet, both even.
    """

    def __init__(
        self,
        views: Views,
        aspects: Mapping[str, float],
        captions: Captions,
        *,
        width_px: int = DESIGN_WIDTH_PX,
        half_extent_m: float = 72.0,
    ) -> None:
        """Prepare the layout.

        Args:
            views: What is shown.
            aspects: Width over height of each topic's picture.
            captions: The words.
            width_px: Width of the sheet, even; its height follows.
            half_extent_m: From the ego to the edge of the lidar's picture.
        """
        self._captions = captions
        self._scale = width_px / DESIGN_WIDTH_PX
        self._panels = list(_panels(views, half_extent_m))
        self._margin = round(_MARGIN * self._scale)
        top, gap = round(_HEADER * self._scale), round(_GAP * self._scale)
        self._boxes = place_in_width(_arrange(views, aspects), self._margin, top, width_px - 2 * self._margin, gap)
        bottom = max(box.top + box.height for box in self._boxes.values()) + self._margin
        self.size_px = (width_px, bottom + bottom % 2)

    def draw(self, frame: Frame) -> UInt8Array:
        """(H, W, 3) RGB picture of a frame; a topic without anything recent leaves its place empty."""
        width, height = self.size_px
        sheet = np.full((height, width, 3), BACKGROUND, np.uint8)
        self._draw_header(sheet, frame)
        for panel in self._panels:
            box = self._boxes[panel.topics[0]]
            if any(topic in frame.arrays for topic in panel.topics):
                picture, note = panel.paint(frame.arrays, box), panel.note
            else:
                picture, note = np.full((box.height, box.width, 3), SURFACE, np.uint8), "nothing received"
            draw_picture(sheet, picture, box, _RADIUS * self._scale)
            draw_label(sheet, box, panel.title, note, self._scale)
        return sheet

    def _draw_header(self, sheet: UInt8Array, frame: Frame) -> None:
        """Scene, facts and time, over a line that fills as the scene goes on."""
        scale, captions = self._scale, self._captions
        left, right = self._margin, self.size_px[0] - self._margin
        baseline = 44 * scale
        end = draw_text(sheet, captions.title, left, baseline, size=30 * scale, weight=BOLD)
        draw_text(sheet, captions.facts, end + 20 * scale, baseline, size=18 * scale, color=DIM)
        seconds = (frame.stamp_ns - captions.start_ns) / 1e9
        start = draw_text(sheet, f"{seconds:.2f} s", right, baseline, size=24 * scale, weight=BOLD, right=True)
        place = f"frame {frame.index + 1} of {captions.frames}"
        draw_text(sheet, place, start - 16 * scale, baseline, size=18 * scale, color=DIM, right=True)
        top, height = round(60 * scale), max(1, round(2 * scale))
        done = left + round((right - left) * (frame.index + 1) / captions.frames)
        sheet[top : top + height, left:right] = LINE
        sheet[top : top + height, left:done] = ACCENT


def _arrange(views: Views, aspects: Mapping[str, float]) -> Block:
    """Cameras in rows of a panorama; below them modalities, two by two, beside the views from above."""

    def row(topics: Sequence[str]) -> Row:
        return Row([Tile(topic, aspects[topic]) for topic in topics])

    cameras, others = list(views.cameras.values()), list(views.modalities.values())
    above = [topic for topic in (views.points, next(iter(views.radars), None), views.bev) if topic is not None]
    if len(cameras) == 1:  # it alone would fill the sheet
        return Column([part for part in (row([*cameras, *above]), row(others)) if part.blocks])
    rows = -(-len(cameras) // (3 if len(cameras) <= 6 else 4))
    lengths = [len(cameras) // rows + (i < len(cameras) % rows) for i in range(rows)]
    starts = np.cumsum([0, *lengths]).tolist()
    blocks: list[Block] = [row(cameras[a : a + n]) for a, n in zip(starts, lengths, strict=False)]
    bottom: list[Block] = list(row(above).blocks)
    if len(others) == len(panels.MODALITY_PICTURES) and above:
        bottom.insert(0, Column([row(others[:2]), row(others[2:])]))
    else:
        bottom[:0] = row(others).blocks
    return Column([*blocks, Row(bottom)] if bottom else blocks)


def _panels(views: Views, half_extent_m: float) -> Iterator[_Panel]:
    for camera, topic in views.cameras.items():
        yield _Panel([topic], _words(camera), "", _paint_rgb(topic))
    rgb = views.cameras.get(views.main_camera)
    for modality, topic in views.modalities.items():
        entry = panels.MODALITY_PICTURES[modality]
        note = ", ".join(part for part in (_words(views.main_camera).lower(), entry.note) if part)
        yield _Panel([topic], entry.title, note, _paint_modality(topic, rgb, entry.picture))
    if views.points is not None:
        yield _Panel([views.points], "Lidar", "from above, by class", _paint_points(views.points, half_extent_m))
    if views.radars:
        yield _Panel(list(views.radars), "Radar", "blue approaches, red recedes", _paint_radars(views, half_extent_m))
    if views.bev is not None:
        yield _Panel([views.bev], "Bird's-eye view", "ground truth", _paint_bev(views.bev))


def _paint_rgb(topic: str) -> _Paint:
    return lambda arrays, box: arrays[topic]


def _paint_modality(topic: str, rgb: str | None, picture: panels.ModalityPicture) -> _Paint:
    return lambda arrays, box: picture(arrays[topic], arrays.get(rgb) if rgb else None, box.width)


def _paint_points(topic: str, half_extent_m: float) -> _Paint:
    return lambda arrays, box: panels.lidar_picture(arrays[topic], box.width, half_extent_m)


def _paint_radars(views: Views, half_extent_m: float) -> _Paint:
    def paint(arrays: Mapping[str, AnyArray], box: Box) -> UInt8Array:
        clouds = [(arrays[topic], pose) for topic, pose in views.radars.items() if topic in arrays]
        return panels.radar_picture(clouds, box.width, half_extent_m)

    return paint


def _paint_bev(topic: str) -> _Paint:
    return lambda arrays, box: panels.bev_picture(arrays[topic], box.width)


def _words(camera: str) -> str:
    """``cam_front_left`` → ``Front left``."""
    return camera.removeprefix("cam_").replace("_", " ").capitalize()
