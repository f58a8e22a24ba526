"""Describes the roads of a map as OpenStreetMap does: ways from junction to junction with tags."""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from simbev_ros.foundation.tables import load_table
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.network import Lane, RoadNetwork
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.polylines import Polylines
from simbev_ros.maps.sumo.net import SumoNet, read_sumo_net

_COINCIDES_M = 0.75
_SAME_DECK_M = 3.0
_KMH_PER_MPS = 3.6


@dataclass(frozen=True, slots=True)
class Carriageway:
    """One way of OpenStreetMap.

    Attributes:
        line_m: (N, 3) center line of both directions, or of a one-way road, map frame, in driving direction.
        ends: Ids of the junctions at its start and its end.
        tags: Tags of the way.
    """

    line_m: Float64Array
    ends: tuple[str, str]
    tags: Mapping[str, str]


def carriageways_of(network: RoadNetwork) -> Iterator[Carriageway]:
    """The carriageways of a map outside its junctions, in the order of its net."""
    net = read_sumo_net(network.net_path)
    lanes = _lanes_by_edge(network, net)
    inner_m = _inner_borders_m(lanes, net.left_hand)
    back = _opposite_edges(net, inner_m)
    written: set[str] = set()
    levels = _Levels(network)
    for edge, edge_lanes in lanes.items():
        if edge in written:
            continue
        opposite = back.get(edge)
        written |= {edge, *([opposite] if opposite else [])}
        line_m = inner_m[edge] if opposite else _middle_m(edge_lanes)
        tags = _tags(edge_lanes, lanes[opposite] if opposite else [], net.left_hand)
        yield Carriageway(line_m, net.edge_ends[edge], {**tags, **levels.tags(line_m, edge in net.structures)})


def _lanes_by_edge(network: RoadNetwork, net: SumoNet) -> dict[str, list[Lane]]:
    """Lanes of each edge outside junctions, from the curb inward."""
    lanes: dict[str, list[Lane]] = defaultdict(list)
    for lane in network.lanes.values():
        if lane.edge in net.edge_ends:
            lanes[lane.edge].append(lane)
    return {edge: sorted(parallel, key=lambda lane: lane.index) for edge, parallel in lanes.items()}


def _inner_borders_m(lanes: Mapping[str, Sequence[Lane]], left_hand: bool) -> dict[str, Float64Array]:
    """(N, 3) border of each edge towards oncoming traffic."""
    inner = [parallel[-1] for parallel in lanes.values()]
    lines = Polylines.from_lines([lane.centerline_m for lane in inner])
    half_m = np.array([lane.width_m for lane in inner])[lines.row] / 2.0
    border_m = lines.offset_to_left(-half_m if left_hand else half_m)
    return dict(zip(lanes, lines.split(border_m), strict=True))


def _opposite_edges(net: SumoNet, inner_m: Mapping[str, Float64Array]) -> dict[str, str]:
    """Edge → the edge back between the same junctions whose inner border is the same line."""
    by_ends = defaultdict(list)
    for edge in inner_m:
        by_ends[net.edge_ends[edge]].append(edge)
    found: dict[str, str] = {}
    for edge in inner_m:
        line = shapely.LineString(inner_m[edge])
        for other in by_ends[net.edge_ends[edge][::-1]]:
            coincides = shapely.hausdorff_distance(line, shapely.LineString(inner_m[other])) < _COINCIDES_M
            if coincides and edge != other and edge not in found and other not in found:
                found[edge], found[other] = other, edge
    return found


def _middle_m(lanes: Sequence[Lane]) -> Float64Array:
    """(N, 3) middle of a one-way road's lanes for vehicles, or of its path."""
    driven = [lane for lane in lanes if lane.kind is LaneKind.DRIVING] or list(lanes)
    first, last = (Polylines.from_lines([lane.centerline_m]) for lane in (driven[0], driven[-1]))
    stations = first.station_m / max(float(first.length_m[0]), 1e-6) * float(last.length_m[0])
    others_m = last.values(last.parameter(np.zeros(len(stations), np.int64), stations))
    return np.asarray((first.points_m + others_m) / 2.0)


def _tags(forward: Sequence[Lane], backward: Sequence[Lane], left_hand: bool) -> dict[str, str]:
    """Tags of a road with these lanes, from the curb inward."""
    counts = [sum(lane.kind is LaneKind.DRIVING for lane in side) for side in (forward, backward)]
    if not any(counts):
        return {"highway": "cycleway" if any(lane.kind is LaneKind.BICYCLE for lane in forward) else "footway"}
    driven = [lane for lane in (*forward, *backward) if lane.kind is LaneKind.DRIVING]
    kmh = round(max(lane.speed_mps for lane in driven) * _KMH_PER_MPS)
    tags = {
        "highway": _class_of(kmh, max(counts), not backward),
        "maxspeed": str(kmh),
        "oneway": "no" if backward else "yes",
        "lanes": str(sum(counts)),
        "sidewalk": _sidewalk(forward, backward, left_hand),
    }
    if backward:
        for side, count, name in zip((forward, backward), counts, ("forward", "backward"), strict=True):
            tags |= {f"lanes:{name}": str(count), f"width:lanes:{name}": _widths(side, left_hand)}
    else:
        tags["width:lanes"] = _widths(forward, left_hand)
    if any(lane.kind is LaneKind.BICYCLE for lane in (*forward, *backward)):
        tags["cycleway"] = "lane"
    if left_hand:
        tags["driving_side"] = "left"
    return tags


def _widths(lanes: Sequence[Lane], left_hand: bool) -> str:
    """Widths of driving lanes from left to right, as seen in driving direction."""
    widths = [f"{lane.width_m:.2f}" for lane in lanes if lane.kind is LaneKind.DRIVING]
    return "|".join(widths if left_hand else reversed(widths))


def _class_of(kmh: float, lane_count: int, one_way: bool) -> str:
    """Value of ``highway``."""
    for rule in load_table("simbev_ros.export.maps", "osm_tags.yaml")["classes"]:
        if kmh >= rule["from_kmh"] and lane_count >= rule["lanes"] and (one_way or not rule.get("one_way")):
            return str(rule["highway"])
    raise AssertionError("the last class has no condition")


def _sidewalk(forward: Sequence[Lane], backward: Sequence[Lane], left_hand: bool) -> str:
    """Value of ``sidewalk``; the curb of the forward direction is on the right, or on the left where traffic is."""
    near, far = (any(lane.kind is LaneKind.SIDEWALK for lane in side) for side in (forward, backward))
    if near and far:
        return "both"
    if not (near or far):
        return "no"
    return "right" if near != left_hand else "left"


class _Levels:
    """Finds the level of roads."""

    def __init__(self, network: RoadNetwork) -> None:
        raised = [strip for strip in network.layout.strips if strip.level > 0]
        self._level = np.array([strip.level for strip in raised], np.int64)
        self._height_m = np.array([float(strip.center_m[:, 2].mean()) for strip in raised])
        self._tree = shapely.STRtree([shapely.LineString(strip.center_m[:, :2]).buffer(2.0) for strip in raised])

    def tags(self, line_m: Float64Array, is_structure: bool) -> dict[str, str]:
        """Tags of a road that is on a bridge for most of its length."""
        middle_m = line_m[len(line_m) // 2]
        near = self._tree.query(shapely.Point(middle_m[:2]), predicate="intersects")
        near = near[np.abs(self._height_m[near] - middle_m[2]) < _SAME_DECK_M]
        level = int(self._level[near].max(initial=0))
        return {"bridge": "yes", "layer": str(max(level, 1))} if level or is_structure else {}
