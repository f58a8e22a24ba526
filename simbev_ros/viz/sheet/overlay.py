"""Labels drawn over pictures: the bird's-eye view on the ground, boxes as wireframes and from above."""

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np

from simbev_ros.config.camera import Camera
from simbev_ros.geometry.transforms import SENSOR_FROM_OPTICAL, inverse
from simbev_ros.palette import class_color
from simbev_ros.semantics import BOX_CLASSES
from simbev_ros.types import AnyArray, BoolArray, Float32Array, Float64Array, Int32Array, Table, UInt8Array
from simbev_ros.viz.box_lines import Lines, fronts, outlines, wireframes
from simbev_ros.viz.sheet.ground_tint import ground_labels, tint_ground
from simbev_ros.viz.sheet.truth import Truth

LEAST_VISIBILITY = 0.05
"""Boxes of which a smaller share is seen are not drawn over cameras."""

_FAINT = 0.3
"""Strength of lines that are behind something, and from above of boxes that were not measured."""

_FARTHEST_M, _FAR = 120.0, 0.4
"""At this distance and beyond, lines have this strength; below it grows towards the camera."""

_FRONT = 0.2
"""Strength of the front faces."""

_LEVELS = 5
_HIDDEN_M, _HIDDEN_SHARE = 0.1, 0.03
"""So far behind what the camera sees a line is hidden: metres, and share of the depth (pixels are coarse)."""

_FRACTION_BITS = 4


@dataclass(frozen=True, slots=True)
class Sight:
    """What a camera saw at one time.

    Attributes:
        rgb: (H, W, 3).
        depth_m: (H, W) along the optical axis: tells what hides ground and boxes.
        tags: (H, W) semantic tags: tell ground from what stands on it.
    """

    rgb: UInt8Array
    depth_m: Float32Array | None = None
    tags: UInt8Array | None = None


def camera_labels(
    sight: Sight, camera: Camera, truth: Truth, size_px: tuple[int, int], *, half_extent_m: float, line_px: float
) -> UInt8Array:
    """A camera's picture with the ground in the colours of its labels and with boxes as wireframes.

    Args:
        sight: The picture.
        camera: That of the rig.
        truth: At the picture's time.
        size_px: Width and height of the result.
        half_extent_m: From the ego to the left edge of the labels.
        line_px: Width of the lines.
    """
    ego_from_optical = camera.pose.ego_from_sensor @ SENSOR_FROM_OPTICAL
    way = cv2.INTER_AREA if camera.width_px > size_px[0] else cv2.INTER_CUBIC
    picture = np.asarray(cv2.resize(sight.rgb, size_px, interpolation=way), np.uint8)
    if truth.labels is not None:
        cell_m = 2 * half_extent_m / truth.labels.shape[1]
        seen = ground_labels(
            camera.model, ego_from_optical, truth, cell_m, size_px, depth_m=sight.depth_m, tags=sight.tags
        )
        picture = tint_ground(picture, seen)
    if truth.boxes is not None:
        optical_from_map = inverse(truth.map_from_ego @ ego_from_optical)
        draw_wireframes(picture, truth.boxes, camera, optical_from_map, sight.depth_m, line_px)
    return picture


def draw_wireframes(
    picture: UInt8Array,
    boxes: Table,
    camera: Camera,
    optical_from_map: Float64Array,
    depth_m: Float32Array | None,
    line_px: float,
) -> None:
    """Draw boxes over a camera's picture of any size; those of which nothing is seen are left out.

    Args:
        picture: Changed in place.
        boxes: (N,) rows of /ego/boxes.
        camera: That of the rig.
        optical_from_map: (4, 4), at the picture's time.
        depth_m: (H, W) of the camera at that time; None: nothing hides anything.
        line_px: Width of the lines.
    """
    lines = wireframes(boxes, camera.model, optical_from_map)
    hidden = _hidden(lines, depth_m)
    in_sight = np.bincount(lines.row[~hidden], minlength=len(boxes)) > 0
    strength = _strengths(boxes) * in_sight
    classes = _column(boxes, "class", 255)
    factor = np.array(picture.shape[1::-1]) / [camera.width_px, camera.height_px]
    faces, row = fronts(boxes, camera.model, optical_from_map)
    layer = picture.copy()
    for face, kind in zip(_fixed(faces, factor)[strength[row] > 0], classes[row[strength[row] > 0]], strict=True):
        cv2.fillConvexPoly(layer, face, _class_colors()[kind], cv2.LINE_AA, _FRACTION_BITS)
    _blend(picture, layer, _FRONT)
    levels = np.rint(strength[lines.row] * np.where(hidden, _FAINT, 1.0) * _LEVELS)
    for level in range(1, _LEVELS + 1):
        these = levels == level
        _draw_lines(picture, _fixed(lines.pixels[these], factor), classes[lines.row[these]], level / _LEVELS, line_px)


def draw_boxes_from_above(
    picture: UInt8Array,
    boxes: Table,
    frame_from_map: Float64Array,
    *,
    half_extent_m: float,
    line_px: float,
    faint_without: str,
) -> None:
    """Draw rectangles with a line to the front, x up and y to the left, the frame's origin in the middle.

    Args:
        picture: Changed in place.
        boxes: (N,) rows of /ego/boxes.
        frame_from_map: (4, 4); z points up.
        half_extent_m: From the middle to the left edge.
        line_px: Width of the lines.
        faint_without: A column; boxes with 0 there are faint.
    """
    size_px = np.array(picture.shape[1::-1])
    places = outlines(boxes, frame_from_map)[..., ::-1]
    pixels = size_px / 2 - places * size_px[0] / (2 * half_extent_m) - 0.5
    near = (np.abs(pixels - size_px / 2) < size_px).all(axis=(1, 2))
    faint = _column(boxes, faint_without, -1) == 0
    classes = _column(boxes, "class", 255)
    for strength, these in ((_FAINT, near & faint), (1.0, near & ~faint)):
        pieces = pixels[these][:, [[0, 1], [1, 2], [2, 3], [3, 0], [4, 5]]]
        _draw_lines(picture, _fixed(pieces.reshape(-1, 2, 2)), np.repeat(classes[these], 5), strength, line_px)


def _strengths(boxes: Table) -> Float64Array:
    """(N,) in 0..1: what is far or mostly hidden is weak; 0 for what is hidden."""
    visibility = np.asarray(_column(boxes, "visibility", np.nan), np.float64)
    visibility = np.where(np.isfinite(visibility), visibility, 1.0)
    near = 1.0 - (1.0 - _FAR) * np.minimum(_column(boxes, "distance", 0.0) / _FARTHEST_M, 1.0)
    strength: Float64Array = near * np.clip(2.0 * visibility, 0.5, 1.0) * (visibility >= LEAST_VISIBILITY)
    return strength


def _hidden(lines: Lines, depth_m: Float32Array | None) -> BoolArray:
    """(S,) whether a line is behind what the camera sees there, or outside the image."""
    if depth_m is None:
        return np.zeros(len(lines.row), bool)
    size_px = np.array(depth_m.shape[::-1])
    middle = np.rint(lines.pixels.mean(axis=1)).astype(np.intp)
    outside = ((middle < 0) | (middle >= size_px)).any(axis=1)
    column, row = np.clip(middle, 0, size_px - 1).T
    hidden: BoolArray = outside | (lines.depth_m > depth_m[row, column] * (1 + _HIDDEN_SHARE) + _HIDDEN_M)
    return hidden


def _draw_lines(picture: UInt8Array, pixels: Int32Array, classes: AnyArray, strength: float, line_px: float) -> None:
    """Draw (S, 2, 2) lines, each in the colour of its box class."""
    layer = picture.copy()
    for kind in np.unique(classes).tolist():
        these = list(pixels[classes == kind])
        cv2.polylines(layer, these, False, _class_colors()[kind], max(1, round(line_px)), cv2.LINE_AA, _FRACTION_BITS)
    _blend(picture, layer, strength)


def _blend(picture: UInt8Array, layer: UInt8Array, strength: float) -> None:
    np.copyto(picture, cv2.addWeighted(layer, strength, picture, 1 - strength, 0))


def _fixed(pixels: Float64Array, factor: Float64Array | float = 1.0) -> Int32Array:
    """Places in a picture that is larger by a factor, in OpenCV's fixed-point numbers."""
    return np.rint(((pixels + 0.5) * factor - 0.5) * (1 << _FRACTION_BITS)).astype(np.int32)


def _column(boxes: Table, name: str, missing: float) -> AnyArray:
    """A column, which older bags may lack."""
    return boxes[name] if name in (boxes.dtype.names or ()) else np.full(len(boxes), missing)


@lru_cache(maxsize=1)
def _class_colors() -> list[tuple[float, ...]]:
    """Colour of each box class, grey for all other numbers below 256; a little lighter, to show on the dark."""
    colors = np.full((256, 3), 160.0)
    colors[: len(BOX_CLASSES)] = [class_color(name) for name in BOX_CLASSES]
    return [tuple(color) for color in (0.8 * colors + 0.2 * 255).round().tolist()]
