"""Curves in plan view for the town patterns: rounded corners, offset lines, smooth connections.

All lines are (N, 2) float64, map frame, meters.
"""

import numpy as np

from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.plan.lines import VERTEX_SPACING_M, densify, length_m, points_at

_STRAIGHT_SPACING_M = 20.0


def point_at(line_m: Float64Array, at_m: float) -> Float64Array:
    """(2,) point at a distance from a line's start."""
    return np.asarray(points_at(line_m, np.array([at_m]))[0])


def heading_at(line_m: Float64Array, at_m: float) -> Float64Array:
    """(2,) unit vector along a line at a distance from its start."""
    total_m = length_m(line_m)
    ahead = point_at(line_m, min(at_m + 1.0, total_m)) - point_at(line_m, max(at_m - 1.0, 0.0))
    return np.asarray(ahead / np.linalg.norm(ahead))


def resample(line_m: Float64Array, spacing_m: float = VERTEX_SPACING_M) -> Float64Array:
    """Resample a line with evenly spaced vertices, keeping its ends."""
    total_m = length_m(line_m)
    return points_at(line_m, np.linspace(0.0, total_m, max(2, round(total_m / spacing_m) + 1)))


def offset_to_right(line_m: Float64Array, offset_m: float | Float64Array, closed: bool = False) -> Float64Array:
    """Offset a line to its right (negative: left) by one or (N,) distances, along its vertex normals."""
    ahead = np.gradient(line_m, axis=0)
    if closed:
        ahead[[0, -1]] = line_m[1] - line_m[-2]
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    return line_m + np.column_stack([ahead[:, 1], -ahead[:, 0]]) * np.reshape(offset_m, (-1, 1))


def round_corners(points_m: Float64Array, radius_m: float, closed: bool = False) -> Float64Array:
    """Replace the corners of a polygon or polyline by arcs, connected by straight segments.

    An arc is smaller than ``radius_m`` if the sides of its corner are too short for it. A closed line starts at the
    beginning of its longest side, and ends with the same vertex.
    """
    corners = np.asarray(points_m, dtype=np.float64)
    if closed:
        sides_m = np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)
        corners = np.roll(corners, -1 - int(np.argmax(sides_m)), axis=0)
        corners = np.concatenate([corners[-1:], corners, corners[:1]])
    arcs = [_arc(corners[index : index + 3], radius_m) for index in range(len(corners) - 2)]
    ends = (arcs[-1][-1:], np.empty((0, 2))) if closed else (corners[:1], corners[-1:])
    return densify(np.concatenate([ends[0], *arcs, ends[1]]), _STRAIGHT_SPACING_M)


def _arc(corners_m: Float64Array, radius_m: float) -> Float64Array:
    """Vertices of the arc that replaces the middle one of three corners."""
    before, corner, after = corners_m
    back, ahead = before - corner, after - corner
    back_m, ahead_m = np.linalg.norm(back), np.linalg.norm(ahead)
    back, ahead = back / back_m, ahead / ahead_m
    turn_rad = np.pi - np.arccos(np.clip(back @ ahead, -1.0, 1.0))
    if turn_rad < 1e-3:
        return corners_m[1:2]
    tangent_m = min(radius_m * np.tan(turn_rad / 2.0), 0.49 * back_m, 0.49 * ahead_m)
    radius_m = tangent_m / np.tan(turn_rad / 2.0)
    middle = (back + ahead) / np.linalg.norm(back + ahead)
    center = corner + middle * radius_m / np.cos(turn_rad / 2.0)
    steps = max(2, int(np.ceil(radius_m * turn_rad / VERTEX_SPACING_M)))
    angle = np.linspace(-0.5, 0.5, steps + 1)[:, None] * turn_rad
    across = (ahead - back) / np.linalg.norm(ahead - back)
    return np.asarray(center - radius_m * (np.cos(angle) * middle - np.sin(angle) * across))


def bezier_between(
    start_m: Float64Array,
    start_heading: Float64Array,
    end_m: Float64Array,
    end_heading: Float64Array,
    handles: tuple[float, float] = (0.4, 0.4),
) -> Float64Array:
    """A cubic Bezier curve between two points with given directions.

    Args:
        start_m: (2,) start point.
        start_heading: (2,) unit vector.
        end_m: (2,) end point.
        end_heading: (2,) unit vector.
        handles: Lengths of the curve's first and last control handle, as fractions of the distance.
    """
    span_m = float(np.linalg.norm(end_m - start_m))
    control = np.stack(
        [start_m, start_m + handles[0] * span_m * start_heading, end_m - handles[1] * span_m * end_heading, end_m]
    )
    t = np.linspace(0.0, 1.0, 200)[:, None]
    weights = np.concatenate([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t**2 * (1 - t), t**3], axis=1)
    return resample(weights @ control)
