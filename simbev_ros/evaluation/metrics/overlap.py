"""Exact intersection over union of upright 3D boxes, in batches of pairs."""

import numpy as np

from simbev_ros.evaluation.metrics.boxes import Boxes
from simbev_ros.foundation.types import Float64Array, Int64Array

_CHUNK = 8192
"""Number of pairs in a batch: temporaries stay in the cache, and memory is bounded."""
_MIN_SLOPE = 1e-12
"""Minimum absolute sine and cosine, so that edges along an axis need no special case."""
_CORNERS = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]], np.float64)


def iou_of_pairs(boxes: Boxes, others: Boxes, box: Int64Array, other: Int64Array) -> Float64Array:
    """Intersection over union of pairs of upright boxes.

    Args:
        boxes: Boxes.
        others: Other boxes, in the same coordinate frame.
        box: (K,) index into ``boxes`` of each pair.
        other: (K,) index into ``others`` of each pair.

    Returns:
        (K,) intersection over union of the volumes, 0 … 1; 0 if both boxes have no volume.
    """
    result = np.zeros(len(box))
    for start in range(0, len(box), _CHUNK):
        part = slice(start, start + _CHUNK)
        result[part] = _iou(boxes, others, box[part], other[part])
    return result


def aligned_iou(size_m: Float64Array, other_size_m: Float64Array) -> Float64Array:
    """(K,) IoU of boxes of (K, 3) sizes with the same center and orientation; 0 if neither has a volume."""
    return _over_union(np.minimum(size_m, other_size_m).prod(axis=1), size_m, other_size_m)


def _iou(boxes: Boxes, others: Boxes, box: Int64Array, other: Int64Array) -> Float64Array:
    size_m, other_size_m = boxes.size_m[box], others.size_m[other]
    offset_m = boxes.center_m[box] - others.center_m[other]
    common_height_m = (size_m[:, 2] + other_size_m[:, 2]) / 2 - np.abs(offset_m[:, 2])
    common_height_m = np.clip(common_height_m, 0, np.minimum(size_m[:, 2], other_size_m[:, 2]))
    yaw_rad = others.yaw_rad[other]
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    offset_other_m = np.stack(
        [offset_m[:, 0] * cos + offset_m[:, 1] * sin, offset_m[:, 1] * cos - offset_m[:, 0] * sin], axis=1
    )
    turn_rad = boxes.yaw_rad[box] - yaw_rad
    area_m2 = _common_area_m2(offset_other_m, turn_rad, size_m[:, :2] / 2, other_size_m[:, :2] / 2)
    return _over_union(area_m2 * common_height_m, size_m, other_size_m)


def _over_union(common_m3: Float64Array, size_m: Float64Array, other_size_m: Float64Array) -> Float64Array:
    union_m3 = size_m.prod(axis=1) + other_size_m.prod(axis=1) - common_m3
    result: Float64Array = np.divide(common_m3, union_m3, out=np.zeros_like(common_m3), where=union_m3 > 0)
    return np.minimum(result, 1.0, out=result)


def _common_area_m2(
    center_m: Float64Array, turn_rad: Float64Array, half_m: Float64Array, fixed_half_m: Float64Array
) -> Float64Array:
    """Area shared by a rotated rectangle and an axis-aligned one at the origin.

    Along x, the shared length along y is linear between breaks: corners, crossings, and the ends of the axis-aligned
    rectangle. Its value halfway between two breaks, times their distance, is therefore exact.

    Args:
        center_m: (K, 2) center of the rotated rectangle.
        turn_rad: (K,) rotation.
        half_m: (K, 2) half its length and width.
        fixed_half_m: (K, 2) half the length and width of the axis-aligned rectangle.

    Returns:
        (K,) area.
    """
    cos, sin = _away_from_zero(np.cos(turn_rad))[:, None], _away_from_zero(np.sin(turn_rad))[:, None]
    corner_m = half_m[:, None] * _CORNERS
    x_m = center_m[:, :1] + corner_m[..., 0] * cos - corner_m[..., 1] * sin
    y_m = center_m[:, 1:] + corner_m[..., 0] * sin + corner_m[..., 1] * cos
    end_m, side_m = fixed_half_m[:, :1], fixed_half_m[:, 1:]
    breaks_m = np.concatenate([x_m, _crossings_m(x_m, y_m, side_m), _crossings_m(x_m, y_m, -side_m)], axis=1)
    breaks_m = np.concatenate([np.clip(breaks_m, -end_m, end_m), -end_m, end_m], axis=1)
    breaks_m.sort(axis=1)
    middle_m = (breaks_m[:, 1:] + breaks_m[:, :-1]) / 2 - center_m[:, :1]
    along_m, across_m = np.abs(half_m[:, :1] / sin), np.abs(half_m[:, 1:] / cos)
    along_at_m, across_at_m = -middle_m * (cos / sin), middle_m * (sin / cos)
    top_m = np.minimum(along_at_m + along_m, across_at_m + across_m) + center_m[:, 1:]
    bottom_m = np.maximum(along_at_m - along_m, across_at_m - across_m) + center_m[:, 1:]
    length_m = np.minimum(top_m, side_m) - np.maximum(bottom_m, -side_m)
    return (np.maximum(length_m, 0.0) * np.diff(breaks_m, axis=1)).sum(axis=1)


def _crossings_m(x_m: Float64Array, y_m: Float64Array, side_m: Float64Array) -> Float64Array:
    """(K, 4) x where the edges of (K, 4) corners cross y = ``side_m``; the x of a corner where they do not."""
    rise_m, run_m = np.roll(y_m, -1, axis=1) - y_m, np.roll(x_m, -1, axis=1) - x_m
    low_m, high_m = np.minimum(y_m, y_m + rise_m), np.maximum(y_m, y_m + rise_m)
    crosses = (low_m < side_m) & (side_m < high_m)
    share = np.divide(side_m - y_m, rise_m, out=np.zeros_like(rise_m), where=crosses)
    return x_m + share * run_m


def _away_from_zero(values: Float64Array) -> Float64Array:
    return np.copysign(np.maximum(np.abs(values), _MIN_SLOPE), values)
