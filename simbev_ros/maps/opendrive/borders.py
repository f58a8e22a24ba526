"""Computes the borders of lanes in 3D from a road's reference line, elevation, banking, lane offset and lane widths."""

import numpy as np

from simbev_ros.foundation.types import BoolArray, Float64Array
from simbev_ros.maps.opendrive.reading.document import Road, Section

_BEFORE_M = 1e-6


def borders_m(road: Road, section: Section, left: bool, s_m: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Borders of the lanes on one side of a section.

    Args:
        road: The road.
        section: One of its sections.
        left: Whether the section is on the left side of the road.
        s_m: (N,) distances along the road, within the section. At the section's end, the records that apply just before
            it are used.

    Returns:
        (1 + L, N, 3) the center line and the outer border of each of L lanes, map frame; and ``lane_edges_m``.
    """
    before_m = np.minimum(s_m, section.end_m - _BEFORE_M)
    side = 1.0 if left else -1.0
    edges_m = lane_edges_m(section, s_m)
    steps_m = np.concatenate([road.offset(before_m)[None], np.diff(edges_m, axis=0) * side])
    on_level = np.array([False, *(lane.on_level for lane in section.lanes)])
    return _in_space(road, s_m, before_m, steps_m, on_level), edges_m


def point_m(road: Road, s_m: float, t_m: float) -> Float64Array:
    """(3,) map frame position of the point ``t_m`` to the left of the reference line, on the road's banked surface."""
    return points_m(road, np.array([s_m]), np.array([t_m]))[0]


def points_m(road: Road, s_m: Float64Array, t_m: Float64Array) -> Float64Array:
    """(N, 3) map frame positions of points (N,) ``t_m`` to the left of the reference line, as in ``point_m``."""
    return _in_space(road, s_m, s_m, t_m[None], np.array([False]))[0]


def lane_edges_m(section: Section, s_m: Float64Array) -> Float64Array:
    """(1 + L, N) distances of the borders on one side from the center line, outward; never decreasing."""
    ds_m = np.minimum(s_m, section.end_m - _BEFORE_M) - section.start_m
    edges_m = [np.zeros(len(s_m))]
    for lane in section.lanes:
        outer_m = edges_m[-1] + lane.width(ds_m) if lane.width else np.abs(lane.border(ds_m))
        edges_m.append(np.maximum(outer_m, edges_m[-1]))
    return np.stack(edges_m)


def _in_space(
    road: Road, s_m: Float64Array, before_m: Float64Array, steps_m: Float64Array, on_level: BoolArray
) -> Float64Array:
    """(B, N, 3) points to the left of the reference line at the cumulative sums of (B, N) signed steps.

    Steps lie in the banked plane (OpenDRIVE 1.8, 10.5.2); those marked ``on_level`` are horizontal: superelevation,
    crossfall and lateral shape do not apply to them, and they continue at the height of their inner border.
    """
    xy_m, normal, _ = road.plan(s_m)
    across_m = np.cumsum(steps_m, axis=0)
    lift_m = _height_above_plane_m(road, before_m, across_m)
    if road.superelevation or on_level.any():
        roll_rad = np.where(on_level[:, None], 0.0, road.superelevation(before_m))
        cos, sin = np.cos(roll_rad), np.sin(roll_rad)
        rises_m = np.where(on_level[:, None], 0.0, np.diff(lift_m, axis=0, prepend=0.0))
        across_m = np.cumsum(steps_m * cos - rises_m * sin, axis=0)
        lift_m = np.cumsum(steps_m * sin + rises_m * cos, axis=0)
    z_m = road.elevation(before_m) + lift_m
    return np.concatenate([xy_m + across_m[..., None] * normal, z_m[..., None]], axis=2)


def _height_above_plane_m(road: Road, s_m: Float64Array, t_m: Float64Array) -> Float64Array:
    """(B, N) heights above the banked plane, from crossfall and lateral shape, at (N,) s and (B, N) t."""
    lift_m = np.zeros(t_m.shape)
    for sign, fall in zip((1.0, -1.0), road.crossfall, strict=True):
        if fall:
            lift_m -= np.maximum(sign * t_m, 0.0) * np.tan(fall(s_m))
    if road.shape:
        stations_m = np.array([shape.s_m for shape in road.shape])
        heights_m = np.stack([shape.heights(t_m.ravel()).reshape(t_m.shape) for shape in road.shape])
        at = np.interp(s_m, stations_m, np.arange(len(stations_m)))
        low = np.minimum(at.astype(np.int64), len(stations_m) - 1)
        high = np.minimum(low + 1, len(stations_m) - 1)
        columns = np.arange(len(s_m))
        lift_m += (1.0 - (at - low)) * heights_m[low, :, columns].T + (at - low) * heights_m[high, :, columns].T
    return lift_m
