"""Which lanes lie where across a road, and which way traffic runs on them."""

from collections.abc import Sequence

import numpy as np

from simbev_ros.maps.opendrive.borders import lane_edges_m
from simbev_ros.maps.opendrive.reading.document import LaneKey, LaneRecord, Road, Section
from simbev_ros.maps.roads.lane_kind import LaneKind


def sections_at(road: Road, s_m: float) -> list[Section]:
    """The sections of both sides at a distance along a road, beyond its ends those at the ends."""
    inside_m = float(np.clip(s_m, 0.0, road.length_m * (1.0 - 1e-9)))
    return [section for section in road.sections if section.start_m <= inside_m < section.end_m]


def driving_lanes_at(road: Road, s_m: float) -> list[tuple[LaneKey, LaneRecord]]:
    """The driving lanes at a distance along a road."""
    return [
        (LaneKey(road.id, section.index, lane.id), lane)
        for section in sections_at(road, s_m)
        for lane in section.lanes
        if lane.kind is LaneKind.DRIVING
    ]


def reach_m(road: Road, s_m: float, left: bool, kinds: Sequence[LaneKind]) -> float:
    """How far lanes of some kinds reach to one side of the reference line, as a t coordinate."""
    s = np.array([np.clip(s_m, 0.0, road.length_m)])
    offset_m, side = float(road.offset(s)[0]), 1.0 if left else -1.0
    edges_m = [
        float(edge[0])
        for section in sections_at(road, s_m)
        for lane, edge in zip(section.lanes, lane_edges_m(section, s)[1:], strict=True)
        if lane.kind in kinds and (lane.id > 0) == left
    ]
    return offset_m + side * max(edges_m, default=0.0)


def drives_forward_at(road: Road, s_m: float, t_m: float) -> bool:
    """Whether traffic at a place runs as s does: as on the driving lane there, or on the nearest one."""
    s = np.array([np.clip(s_m, 0.0, road.length_m)])
    offset_m = float(road.offset(s)[0])
    gaps_m: list[tuple[float, bool]] = []
    for section in sections_at(road, s_m):
        edges_m = lane_edges_m(section, s)[:, 0]
        for place, lane in enumerate(section.lanes):
            if lane.kind is LaneKind.DRIVING and edges_m[place + 1] > edges_m[place]:
                outward_m = (t_m - offset_m) * (1.0 if lane.id > 0 else -1.0)
                gap_m = max(edges_m[place] - outward_m, outward_m - edges_m[place + 1], 0.0)
                gaps_m.append((float(gap_m), road.drives_forward(lane)))
    return min(gaps_m, key=lambda gap: gap[0])[1] if gaps_m else (t_m < 0.0) != road.left_hand
