"""Comfortable speeds in the bends of lanes; SUMO itself does not slow down for curvature outside junctions."""

from collections.abc import Iterable

import numpy as np

from simbev_ros.maps.network import Lane
from simbev_ros.maps.roads.lane_kind import LaneKind

_MAX_LATERAL_MPS2 = 2.0  # for a driver at the speed limit; scales with the square of a driver's speed factor
_MAX_YAW_RATE_RADPS = 0.6  # likewise, for bends tighter than 5.5 m
_CHORD_M = 6.0


def curve_speeds(lanes: Iterable[Lane]) -> dict[str, float]:
    """Maximum speed in m/s by lane id, for the driving lanes that bend too much for their speed limit."""
    curvatures = ((lane, max(_max_curvature(lane), 1e-6)) for lane in lanes if lane.kind is LaneKind.DRIVING)
    speeds = (
        (lane, min(float(np.sqrt(_MAX_LATERAL_MPS2 / curvature)), _MAX_YAW_RATE_RADPS / curvature))
        for lane, curvature in curvatures
    )
    return {lane.id: speed_mps for lane, speed_mps in speeds if speed_mps < lane.speed_mps}


def _max_curvature(lane: Lane) -> float:
    """Maximum heading change of a lane within a few meters, in rad/m; a short lane counts as part of such a stretch."""
    steps_m = np.diff(lane.centerline_m[:, :2], axis=0)
    heading_rad = np.unwrap(np.arctan2(steps_m[:, 1], steps_m[:, 0]))
    lengths_m = np.linalg.norm(steps_m, axis=1)
    middle_m = np.cumsum(lengths_m) - lengths_m / 2.0
    ahead_rad = np.interp(middle_m + _CHORD_M, middle_m, heading_rad)
    return float(np.abs(ahead_rad - heading_rad).max() / _CHORD_M)
