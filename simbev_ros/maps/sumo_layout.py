"""The layout of roads that come as a SUMO net: strips along its lanes, with paint by rule."""

from collections.abc import Mapping

import numpy as np

from simbev_ros.maps.lane_kind import LaneKind
from simbev_ros.maps.layout import Layout, Strip
from simbev_ros.maps.network import Lane
from simbev_ros.types import Float64Array


def layout_of(lanes: Mapping[str, Lane]) -> Layout:
    """Strips of all lanes, in order."""
    return Layout(tuple(_strip(lane) for lane in lanes.values() if lane.kind is not LaneKind.CROSSING), (), (), ())


def _strip(lane: Lane) -> Strip:
    left_m, right_m = (_beside(lane.centerline_m, side * lane.width_m / 2.0) for side in (1.0, -1.0))
    return Strip(
        id=lane.id,
        lane=lane.id,
        kind=lane.kind,
        left_m=left_m,
        right_m=right_m,
        road=lane.edge,
        junction=lane.junction,
        speed_mps=lane.speed_mps,
        following=lane.successors,
        outline_m=lane.outline_m,
    )


def _beside(line_m: Float64Array, left_m: float) -> Float64Array:
    """(N, 3) line at a distance to the left of an (N, 3) line, corners mitred."""
    heading = np.diff(line_m[:, :2], axis=0)
    heading /= np.linalg.norm(heading, axis=1, keepdims=True)
    normal = np.column_stack([-heading[:, 1], heading[:, 0]])
    before, after = np.concatenate([normal[:1], normal]), np.concatenate([normal, normal[-1:]])
    mitre = before + after
    mitre /= np.maximum(np.sum(mitre * before, axis=1, keepdims=True), 0.2)
    return line_m + left_m * np.column_stack([mitre, np.zeros(len(mitre))])
