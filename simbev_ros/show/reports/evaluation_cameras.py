"""Draws the picture of a camera with ground-truth and predicted boxes over it, as SVG for an evaluation report.

A frame, the outcomes of its boxes and the boxes to draw enter; SVG text leaves.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from simbev_ros.dataset import Frame
from simbev_ros.drawing.box_lines import wireframes
from simbev_ros.evaluation.scene_boxes import Outcomes
from simbev_ros.foundation.geometry.camera import PinholeCamera
from simbev_ros.foundation.geometry.transforms import apply, inverse
from simbev_ros.foundation.types import AnyArray, Float64Array, Table, UInt8Array
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.show.reports.evaluation_pictures import MarkedBoxes
from simbev_ros.show.reports.svg_drawing import Drawing, jpeg
from simbev_ros.show.sheet.overlay import MIN_VISIBILITY
from simbev_ros.show.sheet.views import main_camera_rank

_WIDTH_PX = 960
_SHOWN_KINDS = ("found", "false", "missed")


@dataclass(frozen=True, slots=True)
class _Sight:
    """A camera's last picture up to some frame: the camera's name, the picture's key, and the frame that has it."""

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


def camera_picture(frame: Frame, outcomes: Outcomes, boxes: Sequence[MarkedBoxes]) -> tuple[str, str] | None:
    """Draw boxes over the picture of the camera that sees the most missed boxes.

    Args:
        frame: The frame of the boxes. The picture may be older, as cameras are slower; ground-truth boxes are then
            drawn where they were at that time.
        outcomes: The outcome of each box of the frame.
        boxes: The boxes to draw.

    Returns:
        SVG text and a caption; None if there is no camera picture.
    """
    sights = _sights(frame)
    if not sights:
        return None
    missed = outcomes.table[outcomes.counted & ~outcomes.found]
    missed = missed[np.nan_to_num(missed["visibility"]) >= MIN_VISIBILITY]
    sight = max(sights, key=lambda each: _visible_count(each, missed))
    age_s = (frame.stamp_ns - sight.frame.stamp_ns) / NS_PER_S
    sheet, camera = Drawing(_WIDTH_PX, _WIDTH_PX * sight.camera.height_px / sight.camera.width_px), sight.camera
    sheet.photo(0, 0, (sheet.width, sheet.height), jpeg(_shrink(sight.frame[sight.key])))
    for each in boxes:
        if each.kind in _SHOWN_KINDS:
            _draw(sheet, _at_frame(each, frame, sight.frame), camera, sight.optical_from_map)
    return sheet.svg(), sight.name + (f", {age_s:.2g} s before" if age_s else "")


def _sights(frame: Frame) -> list[_Sight]:
    """The last picture of each camera up to a frame, the front camera first."""
    scene = frame.scene
    keys = {name: f"{name}/rgb" for name, each in scene.calibration.items() if each.camera is not None}
    found = []
    for name in sorted(keys, key=main_camera_rank):
        tick = frame.last_tick(keys[name]) if keys[name] in scene.sources else None
        if tick is not None:
            found.append(_Sight(name, keys[name], frame if tick == frame.tick else scene[tick]))
    return found


def _visible_count(sight: _Sight, table: Table) -> int:
    """Number of boxes with centers inside a picture."""
    centers_map = np.stack([table[axis] for axis in "xyz"], axis=1).astype(np.float64)
    ahead = apply(sight.optical_from_map, centers_map)
    ahead = ahead[sight.camera.depth_m(ahead) > 0]
    pixels = sight.camera.project(ahead)
    return int(((pixels > 0) & (pixels < (sight.camera.width_px, sight.camera.height_px))).all(axis=1).sum())


def _at_frame(boxes: MarkedBoxes, now: Frame, then: Frame) -> MarkedBoxes:
    """Ground-truth boxes as they were at another frame, by id; predictions, without ids, only if it is the same one."""
    if then.tick == now.tick:
        return boxes
    earlier = then["boxes"]
    _, rows, earlier_rows = np.intersect1d(boxes.table["id"], earlier["id"], assume_unique=True, return_indices=True)
    return replace(boxes, table=earlier[earlier_rows], titles=[boxes.titles[row] for row in rows.tolist()])


def _draw(sheet: Drawing, boxes: MarkedBoxes, camera: PinholeCamera, optical_from_map: Float64Array) -> None:
    lines = wireframes(boxes.table, camera, optical_from_map)
    pixels = np.rint((lines.pixels + 0.5) * (sheet.width / camera.width_px)).astype(np.int64)
    hidden = boxes.table["visibility"] < MIN_VISIBILITY
    for row, title in enumerate(boxes.titles):
        if (lines.row == row).any():
            sheet.path(f"{boxes.kind} wire{' hidden' * int(hidden[row])}", _path(pixels[lines.row == row]), title)


def _path(pieces: AnyArray) -> str:
    """SVG path data of (S, 2, 2) line segments; segments that join become one line."""
    text, last = "", None
    for start, end in pieces.tolist():
        if start != end:
            text += ("" if start == last else f"M{start[0]} {start[1]}") + f"L{end[0]} {end[1]}"
            last = end
    return text


def _shrink(rgb: UInt8Array) -> UInt8Array:
    height, width = rgb.shape[:2]
    if width <= _WIDTH_PX:
        return rgb
    size = _WIDTH_PX, round(height * _WIDTH_PX / width)
    return np.asarray(cv2.resize(rgb, size, interpolation=cv2.INTER_AREA), np.uint8)
