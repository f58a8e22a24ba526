"""Draws labels over pictures: bird's-eye-view classes on the ground, boxes as wireframes or from above.

A sensor's picture and the ground truth at its time enter; the picture with labels leaves.
"""

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np

from simbev_ros.config.camera import Camera
from simbev_ros.drawing.box_lines import Lines, box_outlines, front_faces, wireframes
from simbev_ros.foundation.geometry.camera import PinholeCamera
from simbev_ros.foundation.geometry.transforms import SENSOR_FROM_OPTICAL, inverse
from simbev_ros.foundation.semantics import BOX_CLASSES
from simbev_ros.foundation.types import AnyArray, BoolArray, Float32Array, Float64Array, Int32Array, Table, UInt8Array
from simbev_ros.schema.palette import class_color
from simbev_ros.show.sheet.ground_tint import ground_labels, tint_ground
from simbev_ros.show.sheet.truth import Truth

MIN_VISIBILITY = 0.05
"""Minimum visible share of a box that is drawn over a camera's picture."""

_FAINT = 0.3
"""Opacity of occluded lines and, from above, of boxes without sensor points."""

_FADE_DISTANCE_M, _FAR_STRENGTH = 120.0, 0.4
"""Distance from which lines have their minimum opacity, and that opacity; closer lines are more opaque."""

_FRONT_STRENGTH = 0.2
"""Opacity of the front faces."""

_LEVELS = 5
_HIDDEN_M, _HIDDEN_SHARE = 0.1, 0.03
"""Tolerance beyond which a line behind the visible surface is hidden: meters, plus a share of the depth, because pixels
are coarse."""

_FRACTION_BITS = 4


@dataclass(frozen=True, slots=True)
class Sight:
    """Images of one camera at one time.

    Attributes:
        rgb: (H, W, 3) uint8.
        depth_m: (H, W) depth image, by which ground and boxes are occluded; None if unknown.
        tags: (H, W) semantic tags, which distinguish ground from objects on it; None if unknown.
    """

    rgb: UInt8Array
    depth_m: Float32Array | None = None
    tags: UInt8Array | None = None


def draw_camera_labels(
    sight: Sight, camera: Camera, truth: Truth, size_px: tuple[int, int], *, half_extent_m: float, line_px: float
) -> UInt8Array:
    """Draw a camera's picture with the ground tinted by its labels and with boxes as wireframes.

    Args:
        sight: The camera's images.
        camera: The camera of the rig.
        truth: Ground truth at the picture's time.
        size_px: Width and height of the result.
        half_extent_m: Distance from the ego to the left edge of the labels' grid.
        line_px: Width of the lines.

    Returns:
        (height, width, 3) uint8 RGB.
    """
    ego_from_optical = camera.pose.ego_from_sensor @ SENSOR_FROM_OPTICAL
    interpolation = cv2.INTER_AREA if camera.width_px > size_px[0] else cv2.INTER_CUBIC
    picture = np.asarray(cv2.resize(sight.rgb, size_px, interpolation=interpolation), np.uint8)
    if truth.labels is not None:
        cell_m = 2 * half_extent_m / truth.labels.shape[1]
        seen = ground_labels(
            camera.model, ego_from_optical, truth, cell_m, size_px, depth_m=sight.depth_m, tags=sight.tags
        )
        picture = tint_ground(picture, seen)
    if truth.boxes is not None:
        optical_from_map = inverse(truth.map_from_ego @ ego_from_optical)
        draw_wireframes(picture, truth.boxes, camera.model, optical_from_map, sight.depth_m, line_px)
    return picture


def draw_wireframes(
    picture: UInt8Array,
    boxes: Table,
    camera: PinholeCamera,
    optical_from_map: Float64Array,
    depth_m: Float32Array | None,
    line_px: float,
) -> None:
    """Draw boxes as wireframes over a camera's picture of any size, in place; fully occluded boxes are left out.

    Args:
        picture: (h, w, 3) uint8 RGB, changed in place.
        boxes: (N,) rows of /ego/boxes.
        camera: Model of the camera.
        optical_from_map: (4, 4), at the picture's time.
        depth_m: (H, W) depth of the camera at that time; None: nothing is occluded.
        line_px: Width of the lines.
    """
    lines = wireframes(boxes, camera, optical_from_map)
    hidden = _hidden(lines, depth_m)
    in_sight = np.bincount(lines.row[~hidden], minlength=len(boxes)) > 0
    strength = _strengths(boxes) * in_sight
    classes = boxes["class"]
    factor = np.array(picture.shape[1::-1]) / [camera.width_px, camera.height_px]
    faces, row = front_faces(boxes, camera, optical_from_map)
    layer = picture.copy()
    for face, kind in zip(_fixed(faces, factor)[strength[row] > 0], classes[row[strength[row] > 0]], strict=True):
        cv2.fillConvexPoly(layer, face, _class_colors()[kind], cv2.LINE_AA, _FRACTION_BITS)
    _blend(picture, layer, _FRONT_STRENGTH)
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
    """Draw boxes as rectangles with a heading line over a picture from above, in place.

    The frame's origin is in the middle of the picture, x points up and y to the left.

    Args:
        picture: (h, w, 3) uint8 RGB, changed in place.
        boxes: (N,) rows of /ego/boxes.
        frame_from_map: (4, 4), into a frame whose z points up.
        half_extent_m: Distance from the middle to the left edge of the picture.
        line_px: Width of the lines.
        faint_without: Name of a column; boxes with 0 in it are drawn faint.
    """
    size_px = np.array(picture.shape[1::-1])
    corners_m = box_outlines(boxes, frame_from_map)[..., ::-1]
    pixels = size_px / 2 - corners_m * size_px[0] / (2 * half_extent_m) - 0.5
    near = (np.abs(pixels - size_px / 2) < size_px).all(axis=(1, 2))
    faint = boxes[faint_without] == 0
    classes = boxes["class"]
    for strength, these in ((_FAINT, near & faint), (1.0, near & ~faint)):
        pieces = pixels[these][:, [[0, 1], [1, 2], [2, 3], [3, 0], [4, 5]]]
        _draw_lines(picture, _fixed(pieces.reshape(-1, 2, 2)), np.repeat(classes[these], 5), strength, line_px)


def _strengths(boxes: Table) -> Float64Array:
    """(N,) opacities in 0..1: lower for boxes that are far or mostly occluded, 0 below the minimum visibility."""
    visibility = np.asarray(boxes["visibility"], np.float64)
    visibility = np.where(np.isfinite(visibility), visibility, 1.0)
    near = 1.0 - (1.0 - _FAR_STRENGTH) * np.minimum(boxes["distance"] / _FADE_DISTANCE_M, 1.0)
    return near * np.clip(2.0 * visibility, 0.5, 1.0) * (visibility >= MIN_VISIBILITY)


def _hidden(lines: Lines, depth_m: Float32Array | None) -> BoolArray:
    """(S,) whether a line segment is occluded or outside the image."""
    if depth_m is None:
        return np.zeros(len(lines.row), bool)
    size_px = np.array(depth_m.shape[::-1])
    middle = np.rint(lines.pixels.mean(axis=1)).astype(np.intp)
    outside = ((middle < 0) | (middle >= size_px)).any(axis=1)
    column, row = np.clip(middle, 0, size_px - 1).T
    return outside | (lines.depth_m > depth_m[row, column] * (1 + _HIDDEN_SHARE) + _HIDDEN_M)


def _draw_lines(picture: UInt8Array, pixels: Int32Array, classes: AnyArray, strength: float, line_px: float) -> None:
    """Draw (S, 2, 2) lines, each in the color of its box class, in place."""
    layer = picture.copy()
    for kind in np.unique(classes).tolist():
        these = list(pixels[classes == kind])
        cv2.polylines(layer, these, False, _class_colors()[kind], max(1, round(line_px)), cv2.LINE_AA, _FRACTION_BITS)
    _blend(picture, layer, strength)


def _blend(picture: UInt8Array, layer: UInt8Array, strength: float) -> None:
    np.copyto(picture, cv2.addWeighted(layer, strength, picture, 1 - strength, 0))


def _fixed(pixels: Float64Array, factor: Float64Array | float = 1.0) -> Int32Array:
    """Pixel coordinates scaled to a picture larger by ``factor``, as OpenCV's fixed-point numbers."""
    return np.rint(((pixels + 0.5) * factor - 0.5) * (1 << _FRACTION_BITS)).astype(np.int32)


@lru_cache(maxsize=1)
def _class_colors() -> list[tuple[float, ...]]:
    """Color of each box class, gray for all other numbers below 256; lightened for contrast with dark backgrounds."""
    colors = np.full((256, 3), 160.0)
    colors[: len(BOX_CLASSES)] = [class_color(name) for name in BOX_CLASSES]
    return [tuple(color) for color in (0.8 * colors + 0.2 * 255).round().tolist()]
