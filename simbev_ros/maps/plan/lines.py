"""Geometry of lines in plan view: lengths, parts, offsets, arcs. Lines are (N, 2) float64 meters in the map frame."""

import numpy as np
import shapely
from scipy.spatial import cKDTree

from simbev_ros.foundation.geometry.plan_view import left_of
from simbev_ros.foundation.types import Float64Array

VERTEX_SPACING_M = 5.0
"""Distance between vertices of curves."""

_GUARD_VERTEX_M = 15.0
_TOLERANCE_M = 0.01
_MAX_BEND_RAD = np.radians(7.5)


def stations_m(line_m: Float64Array) -> Float64Array:
    """(N,) distances in plan view along an (N, 2 or 3) line."""
    steps_m = np.linalg.norm(np.diff(line_m[:, :2], axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(steps_m)])


def length_m(line_m: Float64Array) -> float:
    """Length in plan view of an (N, 2 or 3) line."""
    return float(stations_m(line_m)[-1])


def densify(line_m: Float64Array, spacing_m: float = VERTEX_SPACING_M) -> Float64Array:
    """Insert vertices into a line so that they are at most about a spacing (up to 10 % more) apart."""
    return shapely.get_coordinates(shapely.segmentize(shapely.LineString(line_m), 1.1 * spacing_m))


def points_at(line_m: Float64Array, queries_m: Float64Array) -> Float64Array:
    """(K, D) points at (K,) stations of an (N, D) line."""
    along_m = stations_m(line_m)
    return np.column_stack([np.interp(queries_m, along_m, column) for column in line_m.T])


def part(line_m: Float64Array, start_m: float, end_m: float) -> Float64Array:
    """The part of an (N, D) line between two stations; beyond the end of a closed line it continues from the start."""
    along_m = stations_m(line_m)
    if end_m > along_m[-1] + 1e-6:
        line_m = np.concatenate([line_m, line_m[1:]])
        along_m = stations_m(line_m)
    inner = line_m[(along_m > start_m + 0.05) & (along_m < end_m - 0.05)]
    ends = points_at(line_m, np.array([start_m, end_m]))
    return np.concatenate([ends[:1], inner, ends[1:]])


def shift_ends(line_m: Float64Array, start_shift_m: Float64Array, end_shift_m: Float64Array) -> Float64Array:
    """Move the ends of a line by (2,) vectors; the shift fades out within 30 m, or half the line."""
    line_m = densify(line_m)
    along_m = stations_m(line_m)
    fade_m = min(30.0, along_m[-1] / 2.0)
    weight_start = np.clip(1.0 - along_m / fade_m, 0.0, 1.0)[:, None]
    weight_end = np.clip(1.0 - (along_m[-1] - along_m) / fade_m, 0.0, 1.0)[:, None]
    return line_m + weight_start * start_shift_m + weight_end * end_shift_m


def offset_to_left(line_m: Float64Array, left_m: float) -> Float64Array:
    """Offset an (N, D) line to the left (negative: right), with mitered corners and unchanged heights."""
    heading = np.diff(line_m[:, :2], axis=0)
    heading /= np.linalg.norm(heading, axis=1, keepdims=True)
    normal = left_of(heading)
    before, after = np.concatenate([normal[:1], normal]), np.concatenate([normal, normal[-1:]])
    miter = before + after
    miter /= np.maximum(np.sum(miter * before, axis=1, keepdims=True), 0.2)
    moved = line_m.copy()
    moved[:, :2] += left_m * miter
    return moved


def arc(center_m: Float64Array, radius_m: float, start_rad: float, turn_rad: float) -> Float64Array:
    """An arc around a center, starting in a direction; counter-clockwise if the turn is positive."""
    count = int(np.ceil(abs(turn_rad) / min(VERTEX_SPACING_M / radius_m, _MAX_BEND_RAD)))
    angle_rad = start_rad + np.linspace(0.0, turn_rad, count + 1)
    return center_m + radius_m * np.column_stack([np.cos(angle_rad), np.sin(angle_rad)])


def simplify(line_m: Float64Array) -> Float64Array:
    """Remove vertices of an (N, 3) line that change neither plan view nor height, except one near each end.

    netconvert cuts a road across the segment of its nearest vertex in plan view. Without a vertex near the end, that
    segment might belong to the other end of a loop.
    """
    along_m = stations_m(line_m)
    kept = np.zeros(len(line_m), bool)
    kept[[0, -1]] = True
    kept[np.abs(along_m[:, None] - [_GUARD_VERTEX_M, along_m[-1] - _GUARD_VERTEX_M]).argmin(axis=0)] = True
    for flat_m in (line_m[:, :2], np.column_stack([along_m, line_m[:, 2]])):
        corners = shapely.get_coordinates(shapely.simplify(shapely.LineString(flat_m), _TOLERANCE_M))
        kept[cKDTree(flat_m).query(corners)[1]] = True
    return line_m[kept]
