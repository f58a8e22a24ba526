"""Speeds at which the bends of lanes can be driven in comfort; SUMO itself knows no curvature outside junctions."""

from collections.abc import Iterable

import numpy as np

from simbev_ros.maps.network import Lane
from simbev_ros.maps.roads.lane_kind import LaneKind

_LATERAL_MPS2 = 2.0  # for a driver who keeps to the speed limit; others differ with the square of their speed factor
_TURNING_RADPS = 0.6  # the same, for bends tighter than 5.5 m
_CHORD_M = 6.0


def bend_speeds(lanes: Iterable[Lane]) -> dict[str, float]:
    """Lane id → highest speed in m/s, for those driving lanes that bend too much for their speed limit."""
    bends = ((lane, max(_largest_curvature(lane), 1e-6)) for lane in lanes if lane.kind is LaneKind.DRIVING)
    speeds = ((lane, min(float(np.sqrt(_LATERAL_MPS2 / bend)), _TURNING_RADPS / bend)) for lane, bend in bends)
    return {lane.id: speed_mps for lane, speed_mps in speeds if speed_mps < lane.speed_mps}


def _largest_curvature(lane: Lane) -> float:
    """The most that a lane turns within a few metres, in rad/m; a short lane is taken as a part of such a stretch."""
    steps_m = np.diff(lane.centerline_m[:, :2], axis=0)
    heading_rad = np.unwrap(np.arctan2(steps_m[:, 1], steps_m[:, 0]))
    lengths_m = np.linalg.norm(steps_m, axis=1)
    middle_m = np.cumsum(lengths_m) - lengths_m / 2.0
    ahead_rad = np.interp(middle_m + _CHORD_M, middle_m, heading_rad)
    return float(np.abs(ahead_rad - heading_rad).max() / _CHORD_M)
