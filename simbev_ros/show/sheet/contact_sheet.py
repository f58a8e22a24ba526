"""Draws one frame of a scene as one picture: cameras, the front camera's other modalities, lidar and labels from above.

The last stage of a preview: a ``SheetFrame`` enters, an RGB picture leaves. The layout is fixed once for a bag.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from simbev_ros.config.modalities import MODALITIES
from simbev_ros.drawing.canvas import ACCENT, BACKGROUND, BOLD, DIM, LINE, SURFACE, draw_label, draw_picture, draw_text
from simbev_ros.foundation.types import UInt8Array
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.show.sheet.frames import SheetFrame
from simbev_ros.show.sheet.layout import Block, Column, Row, Tile, place_in_width
from simbev_ros.show.sheet.sheet_panels import LABEL_PANEL, PanelPainter
from simbev_ros.show.sheet.views import Views

DESIGN_WIDTH_PX = 1920
"""Sheet width in pixels for which the lengths below are given; they scale with the actual width."""

_MARGIN, _GAP, _HEADER, _RADIUS = 24, 10, 78, 7


@dataclass(frozen=True, slots=True)
class Captions:
    """The text on a contact sheet.

    Attributes:
        title: Name of the scene.
        facts: Description of the scene in one line.
        frames: Number of frames of the scene.
        start_ns: Stamp at which the displayed time is zero.
    """

    title: str
    facts: str
    frames: int
    start_ns: int


class ContactSheet:
    """A contact sheet with a layout fixed for one bag, drawn again for each frame.

    Attributes:
        size_px: Width and height of the sheet, both even.
        boxes: Box of each picture on the sheet, by its key or ``LABEL_PANEL``.
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
            aspects: Width over height of each key's picture.
            captions: The text.
            width_px: Width of the sheet, even; its height follows.
            half_extent_m: Distance from the ego to the edge of the lidar's picture.
        """
        self._captions = captions
        self._scale = width_px / DESIGN_WIDTH_PX
        self._panels = list(PanelPainter(views, half_extent_m, self._scale).panels())
        self._margin = round(_MARGIN * self._scale)
        top, gap = round(_HEADER * self._scale), round(_GAP * self._scale)
        self.boxes = place_in_width(_arrange(views, aspects), self._margin, top, width_px - 2 * self._margin, gap)
        bottom = max(box.top + box.height for box in self.boxes.values()) + self._margin
        self.size_px = (width_px, bottom + bottom % 2)

    def draw(self, frame: SheetFrame) -> UInt8Array:
        """Draw a frame as (H, W, 3) uint8 RGB; the box of a key without a recent sample stays empty."""
        width, height = self.size_px
        sheet = np.full((height, width, 3), BACKGROUND, np.uint8)
        self._draw_header(sheet, frame)
        for panel in self._panels:
            box = self.boxes[panel.key]
            if any(key in frame.arrays for key in panel.keys):
                picture, note = panel.paint(frame, box), panel.note
            else:
                picture, note = np.full((box.height, box.width, 3), SURFACE, np.uint8), "nothing received"
            draw_picture(sheet, picture, box, _RADIUS * self._scale)
            draw_label(sheet, box, panel.title, note, self._scale)
        return sheet

    def _draw_header(self, sheet: UInt8Array, frame: SheetFrame) -> None:
        """Write the scene's name, facts and time above a progress line."""
        scale, captions = self._scale, self._captions
        left, right = self._margin, self.size_px[0] - self._margin
        baseline = 44 * scale
        end = draw_text(sheet, captions.title, left, baseline, size=30 * scale, weight=BOLD)
        draw_text(sheet, captions.facts, end + 20 * scale, baseline, size=18 * scale, color=DIM)
        seconds = (frame.stamp_ns - captions.start_ns) / NS_PER_S
        start = draw_text(sheet, f"{seconds:.2f} s", right, baseline, size=24 * scale, weight=BOLD, right=True)
        position = f"frame {frame.index + 1} of {captions.frames}"
        draw_text(sheet, position, start - 16 * scale, baseline, size=18 * scale, color=DIM, right=True)
        top, height = round(60 * scale), max(1, round(2 * scale))
        done = left + round((right - left) * (frame.index + 1) / captions.frames)
        sheet[top : top + height, left:right] = LINE
        sheet[top : top + height, left:done] = ACCENT


def _arrange(views: Views, aspects: Mapping[str, float]) -> Block:
    """The sheet's layout: cameras in panorama rows; below them the modalities and the views with labels.

    Without a picture with labels, all modalities form a block of two rows next to the views from above.
    """

    def row(keys: Sequence[str]) -> Row:
        return Row([Tile(key, aspects[key]) for key in keys])

    cameras, others = list(views.cameras.values()), list(views.modalities.values())
    above = row([key for key in (views.points, next(iter(views.radars), None), views.bev) if key is not None])
    if views.label_panel is not None:
        above = Row([Tile(LABEL_PANEL, aspects[views.label_panel[1].rgb]), *above.blocks])
    if len(cameras) == 1:  # a single camera would fill the sheet
        return Column([part for part in (Row([*row(cameras).blocks, *above.blocks]), row(others)) if part.blocks])
    rows = -(-len(cameras) // (3 if len(cameras) <= 6 else 4))
    lengths = [len(cameras) // rows + (i < len(cameras) % rows) for i in range(rows)]
    starts = np.cumsum([0, *lengths]).tolist()
    blocks: list[Block] = [row(cameras[a : a + n]) for a, n in zip(starts, lengths, strict=False)]
    fill_rows = len(others) >= len(MODALITIES) - 1  # all but the color image
    if views.label_panel is None and fill_rows and above.blocks:
        bottom = [Row([Column([row(others[: len(others) // 2]), row(others[len(others) // 2 :])]), *above.blocks])]
    elif fill_rows:
        bottom = [row(others), above]
    else:
        bottom = [Row([*row(others).blocks, *above.blocks])]
    return Column([*blocks, *(part for part in bottom if part.blocks)])
