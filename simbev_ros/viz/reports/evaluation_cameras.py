"""Pictures of cameras with boxes of the truth and of predictions over them, as SVG."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from simbev_ros.dataset import Frame, Scene
from simbev_ros.evaluation.scene_boxes import Outcomes
from simbev_ros.geometry.camera import PinholeCamera
from simbev_ros.geometry.transforms import apply, inverse
from simbev_ros.types import AnyArray, Float64Array, Table, UInt8Array
from simbev_ros.viz.box_lines import wireframes
from simbev_ros.viz.reports.evaluation_pictures import MarkedBoxes
from simbev_ros.viz.reports.svg_drawing import Drawing, jpeg
from simbev_ros.viz.sheet.overlay import LEAST_VISIBILITY
from simbev_ros.viz.sheet.views import main_place

_WIDTH_PX = 960
_SHOWN = ("found", "false", "missed")


@dataclass(frozen=True, slots=True)
class _Sight:
    """A camera's last picture up to some frame."""

    name: str
    key: str
    frame: Frame

    @property
    def camera(self) -> PinholeCamera:
        camera = self.frame.scene.calibration[self.name].camera
        assert camera is not None
        return camera

    @property
    def optical_from_map(self) -> Float64Array:
        return inverse(self.frame.map_from_optical(self.name))


def in_camera(frame: Frame, outcomes: Outcomes, boxes: Sequence[MarkedBoxes]) -> tuple[str, str] | None:
    """The picture of the camera that has most missed boxes in sight, with boxes over it, and what it is; None: no one.

    Args:
        frame: Of the boxes. Pictures may be older, as cameras are slower; boxes are then drawn where they were.
        outcomes: What became of each box.
        boxes: Those to be drawn.
    """
    sights = _sights(frame)
    if not sights:
        return None
    missed = outcomes.table[outcomes.counted & ~outcomes.found]
    missed = missed[np.nan_to_num(missed["visibility"]) >= LEAST_VISIBILITY]
    sight = max(sights, key=lambda each: _in_sight(each, missed))
    age_s = (frame.stamp_ns - sight.frame.stamp_ns) / 1e9
    sheet, camera = Drawing(_WIDTH_PX, _WIDTH_PX * sight.camera.height_px / sight.camera.width_px), sight.camera
    sheet.photo(0, 0, (sheet.width, sheet.height), jpeg(_smaller(sight.frame[sight.key])))
    for each in boxes:
        if each.kind in _SHOWN:
            _draw(sheet, _then(each, frame, sight.frame), camera, sight.optical_from_map)
    return sheet.svg(), sight.name + (f", {age_s:.2g} s before" if age_s else "")


def _sights(frame: Frame) -> list[_Sight]:
    """The front camera first."""
    scene = frame.scene
    found = []
    for name in sorted((name for name, each in scene.calibration.items() if each.camera is not None), key=main_place):
        key = f"{name}/rgb"
        tick = _last_tick(scene, key, frame.stamp_ns)
        if tick is not None:
            found.append(_Sight(name, key, frame if tick == frame.tick else scene[tick]))
    return found


def _last_tick(scene: Scene, key: str, stamp_ns: int) -> int | None:
    """Of the last sample of a key up to a stamp."""
    stamps_ns = scene.sources[key].stamps_ns if key in scene.sources else np.zeros(0, np.int64)
    before = int(np.searchsorted(stamps_ns, stamp_ns, side="right"))
    return int(np.searchsorted(scene.stamps_ns, stamps_ns[before - 1])) if before else None


def _in_sight(sight: _Sight, table: Table) -> int:
    """How many boxes have their centres in a picture."""
    centers_map = np.stack([table[axis] for axis in "xyz"], axis=1).astype(np.float64)
    ahead = apply(sight.optical_from_map, centers_map)
    ahead = ahead[ahead[:, 2] > 0]
    pixels = sight.camera.project(ahead)
    return int(((pixels > 0) & (pixels < (sight.camera.width_px, sight.camera.height_px))).all(axis=1).sum())


def _then(boxes: MarkedBoxes, now: Frame, then: Frame) -> MarkedBoxes:
    """Boxes of the truth where they were; predictions, of which that is not known, only if it is the same frame."""
    if then.tick == now.tick:
        return boxes
    earlier = then["boxes"]
    _, rows, places = np.intersect1d(boxes.table["id"], earlier["id"], assume_unique=True, return_indices=True)
    return replace(boxes, table=earlier[places], titles=[boxes.titles[row] for row in rows.tolist()])


def _draw(sheet: Drawing, boxes: MarkedBoxes, camera: PinholeCamera, optical_from_map: Float64Array) -> None:
    lines = wireframes(boxes.table, camera, optical_from_map)
    places = np.rint((lines.pixels + 0.5) * (sheet.width / camera.width_px)).astype(np.int64)
    hidden = boxes.table["visibility"] < LEAST_VISIBILITY
    for row, title in enumerate(boxes.titles):
        if (lines.row == row).any():
            sheet.path(f"{boxes.kind} wire{' hidden' * int(hidden[row])}", _path(places[lines.row == row]), title)


def _path(pieces: AnyArray) -> str:
    """(S, 2, 2) lines, those that join up as one."""
    text, last = "", None
    for start, end in pieces.tolist():
        if start != end:
            text += ("" if start == last else f"M{start[0]} {start[1]}") + f"L{end[0]} {end[1]}"
            last = end
    return text


def _smaller(rgb: UInt8Array) -> UInt8Array:
    height, width = rgb.shape[:2]
    if width <= _WIDTH_PX:
        return rgb
    size = _WIDTH_PX, round(height * _WIDTH_PX / width)
    return np.asarray(cv2.resize(rgb, size, interpolation=cv2.INTER_AREA), np.uint8)
