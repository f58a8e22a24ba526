"""Fits arcs and straight lines to center lines, as nuScenes' map expansion describes lanes (``arcline_path_3``).

A polyline enters; a chain of arcs with continuous positions and headings leaves. Each span of the polyline becomes
a biarc: two arcs with a common tangent, with the position and heading of the polyline at both ends (Bolton 1975). It is
as long as the biarc stays within a tolerance of the points that it skips. nuScenes allows three arcs of one radius in
each path; here every path is one arc or one straight line, and its other lengths are 0.
"""

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import shapely

from simbev_ros.foundation.types import Float64Array

_TOLERANCE_M = 0.02
_SIMPLIFIED_M = 0.002
_MIN_POINT_GAP_M, _MAX_POINT_GAP_M = 0.02, 2.0
_MAX_RADIUS_M = 20_000.0
"""Radius from which on an arc is a straight line."""
_STRAIGHT_RADIUS_M = 999.999  # nuScenes' radius of straight paths, which does not matter
_SAMPLE_M = 1.0
_PARALLEL = 1e-9
_DECIMALS = 9


class _Pose(NamedTuple):
    """Position and heading."""

    x_m: float
    y_m: float
    yaw_rad: float


class _Arc(NamedTuple):
    """Arc of constant curvature, positive to the left."""

    start: _Pose
    length_m: float
    curvature_per_m: float

    def at(self, s_m: float) -> _Pose:
        """Pose at a distance from the start."""
        x_m, y_m, yaw_rad = self.start
        half_rad = self.curvature_per_m * s_m / 2.0
        chord_m = s_m * (math.sin(half_rad) / half_rad if abs(half_rad) > _PARALLEL else 1.0)
        towards_rad = yaw_rad + half_rad
        return _Pose(
            x_m + chord_m * math.cos(towards_rad), y_m + chord_m * math.sin(towards_rad), yaw_rad + 2.0 * half_rad
        )


def arcline_path(center_m: Float64Array) -> list[dict[str, Any]]:
    """The records of a lane's path, in driving direction.

    Args:
        center_m: (N, 2+) center line of at least two different points, nuScenes' global frame.
    """
    simple_m = _distinct(np.asarray(shapely.get_coordinates(shapely.simplify(_line(center_m), _SIMPLIFIED_M))))
    points_m = np.asarray(shapely.get_coordinates(shapely.segmentize(_line(simple_m), _MAX_POINT_GAP_M)))
    return [_record(arc) for arc in _arcs(points_m, _headings(points_m))]


def _line(points_m: Float64Array) -> shapely.LineString:
    return shapely.LineString(points_m[:, :2])


def _distinct(points_m: Float64Array) -> Float64Array:
    """Points without those that are too close to the one before for a direction; ends are kept."""
    kept = [0]
    for row in range(1, len(points_m) - 1):
        if min(math.dist(points_m[row], points_m[kept[-1]]), math.dist(points_m[row], points_m[-1])) > _MIN_POINT_GAP_M:
            kept.append(row)
    return points_m[[*kept, len(points_m) - 1]]


def _headings(points_m: Float64Array) -> Float64Array:
    """(N,) headings at points: of the circle through a point and its neighbors; at the ends, of the next circle."""
    steps_m = np.diff(points_m, axis=0)
    if len(steps_m) == 1:
        return np.repeat(np.arctan2(steps_m[:, 1], steps_m[:, 0]), 2)
    length_m = np.linalg.norm(steps_m, axis=1)
    turns_rad = np.unwrap(np.arctan2(steps_m[:, 1], steps_m[:, 0]))
    share = length_m[:-1] / (length_m[:-1] + length_m[1:])
    inner = turns_rad[:-1] + share * np.diff(turns_rad)
    return np.concatenate([[2.0 * turns_rad[0] - inner[0]], inner, [2.0 * turns_rad[-1] - inner[-1]]])


def _arcs(points_m: Float64Array, headings_rad: Float64Array) -> Iterator[_Arc]:
    """The arcs of all spans, each span as long as the tolerance allows."""
    start, last = 0, len(points_m) - 1
    while start < last:
        reach, step = start + 1, 1
        found = _biarc(points_m, headings_rad, start, reach)
        while step and reach < last:
            end = min(reach + step, last)
            longer = _biarc(points_m, headings_rad, start, end)
            if _fits(longer, points_m[start + 1 : end]):
                found, reach, step = longer, end, 2 * step
            else:
                step //= 2
        yield from found
        start = reach


def _fits(arcs: list[_Arc], points_m: Float64Array) -> bool:
    """Whether all points are close to a chain of arcs that do not turn by more than half a circle."""
    if any(abs(arc.length_m * arc.curvature_per_m) > math.pi for arc in arcs):
        return False
    counts = [max(math.ceil(arc.length_m / _SAMPLE_M), 8) for arc in arcs]
    samples = [
        arc.at(arc.length_m * k / count)[:2] for arc, count in zip(arcs, counts, strict=True) for k in range(count + 1)
    ]
    distance_m = shapely.distance(shapely.LineString(samples), shapely.points(points_m))
    return bool((distance_m <= _TOLERANCE_M).all())


def _biarc(points_m: Float64Array, headings_rad: Float64Array, start: int, end: int) -> list[_Arc]:
    """Two arcs from one point to another, with the headings there."""
    first, last = (
        _Pose(float(points_m[row, 0]), float(points_m[row, 1]), float(headings_rad[row])) for row in (start, end)
    )
    ahead = np.array([math.cos(first.yaw_rad), math.sin(first.yaw_rad)])
    beyond = np.array([math.cos(last.yaw_rad), math.sin(last.yaw_rad)])
    chord_m = points_m[end] - points_m[start]
    distance_m = _tangent_length_m(chord_m, ahead, beyond)
    middle_m = (points_m[start] + points_m[end] + distance_m * (ahead - beyond)) / 2.0
    half = _arc_through(first, middle_m)
    return [half, _arc_through(half.at(half.length_m), points_m[end])]


def _tangent_length_m(chord_m: Float64Array, ahead: Float64Array, beyond: Float64Array) -> float:
    """Length of the tangents at both ends of a biarc with its joint in their middle."""
    along_m = float(chord_m @ (ahead + beyond))
    square_m2, bend = float(chord_m @ chord_m), 2.0 * (1.0 - float(ahead @ beyond))
    if bend < _PARALLEL:
        return square_m2 / max(2.0 * along_m, _PARALLEL)
    return (math.sqrt(along_m**2 + bend * square_m2) - along_m) / bend


def _arc_through(start: _Pose, point_m: Float64Array) -> _Arc:
    """The arc that leaves a pose in its heading and ends at a point."""
    x_m, y_m = float(point_m[0]) - start.x_m, float(point_m[1]) - start.y_m
    chord_m = math.hypot(x_m, y_m)
    half_rad = math.remainder(math.atan2(y_m, x_m) - start.yaw_rad, math.tau)
    if abs(half_rad) < _PARALLEL or chord_m == 0.0:
        return _Arc(start, chord_m, 0.0)
    return _Arc(start, chord_m * half_rad / math.sin(half_rad), 2.0 * math.sin(half_rad) / chord_m)


def _record(arc: _Arc) -> dict[str, Any]:
    is_straight = abs(arc.curvature_per_m) * _MAX_RADIUS_M < 1.0
    lengths_m = (0.0, arc.length_m, 0.0) if is_straight else (arc.length_m, 0.0, 0.0)
    return {
        "start_pose": _plain(arc.start),
        "end_pose": _plain(arc.at(arc.length_m)),
        "shape": "RSR" if arc.curvature_per_m < 0 else "LSL",
        "radius": _STRAIGHT_RADIUS_M if is_straight else round(1.0 / abs(arc.curvature_per_m), _DECIMALS),
        "segment_length": [round(length_m, _DECIMALS) for length_m in lengths_m],
    }


def _plain(pose: _Pose) -> list[float]:
    x_m, y_m, yaw_rad = pose
    return [round(x_m, _DECIMALS), round(y_m, _DECIMALS), round(math.remainder(yaw_rad, math.tau), _DECIMALS)]
