"""Places traffic signs where the map has none of its own: stop, yield and speed limit.

An approach that gives way has its sign beside its stop or yield line. Speed limits stand where they begin to hold, and
on long roads after a junction.
"""

from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from simbev_ros.maps.network import Lane
from simbev_ros.maps.roads.lane_kind import ROAD_KINDS, LaneKind
from simbev_ros.maps.roads.layout import Layout, Sign, SignKind, Strip
from simbev_ros.maps.roads.polylines import Polylines
from simbev_ros.maps.roads.surface import strip_polygons
from simbev_ros.maps.sumo.net import SumoNet
from simbev_ros.maps.sumo.right_of_way import minor_approaches
from simbev_ros.types import BoolArray, Float64Array

_BESIDE_M = (0.7, 1.5, 2.5, 3.5, 4.5, 5.5)  # from the lane's edge to the post: the first place off all roads
_BEFORE_END_M = 1.0
_AFTER_START_M = 12.0
_LONG_M = 250.0
_SAME_SPEED_MPS = 0.3
_SHORTEST_M = 5.0
_SAME_HEIGHT_M = 2.0
_CLEAR_M = 0.3


@dataclass(frozen=True, slots=True)
class _Wanted:
    """A sign beside a lane, ``s_m`` from its start."""

    kind: SignKind
    lane: Lane
    s_m: float
    lanes: tuple[str, ...]
    speed_mps: float = 0.0


def place_signs(net: SumoNet, layout: Layout) -> tuple[Sign, ...]:
    """Signs by rule, on the roads of a net.

    Args:
        net: Who gives way to whom, and how fast traffic may go.
        layout: Where lanes lie; a sign that can stand nowhere beside its lane is left out.
    """
    edges: dict[str, list[Lane]] = defaultdict(list)
    for lane in net.lanes.values():
        if not lane.junction and lane.kind is not LaneKind.SIDEWALK and lane.length_m > _SHORTEST_M:
            edges[lane.edge].append(lane)
    driven = {
        edge: sorted(lanes, key=lambda lane: lane.index)
        for edge, lanes in edges.items()
        if any(lane.kind is LaneKind.DRIVING for lane in lanes)
    }
    curb_side = -1.0 if net.left_hand else 1.0
    return tuple(_off_the_road([*_priority_signs(net, driven), *_speed_signs(net, driven)], layout, curb_side))


def _priority_signs(net: SumoNet, edges: Mapping[str, list[Lane]]) -> Iterator[_Wanted]:
    """One sign for each approach that gives way."""
    for edge, kind in minor_approaches(net).items():
        if edge in edges:
            right = edges[edge][0]
            yield _Wanted(kind, right, right.length_m - _BEFORE_END_M, _driving(edges[edge]))


def _speed_signs(net: SumoNet, edges: Mapping[str, list[Lane]]) -> Iterator[_Wanted]:
    """Signs where a limit begins to hold, and where drivers may want to be told again."""
    sources, arms = _sources(net), _arms(net)
    for edge, lanes in edges.items():
        right, speed_mps = lanes[0], _speed_mps(lanes)
        known = [_speed_mps(edges[source]) for source in sources[edge] if source in edges]
        new = not known or any(abs(other_mps - speed_mps) > _SAME_SPEED_MPS for other_mps in known)
        again = right.length_m > _LONG_M and arms[net.edge_ends[edge][0]] > 2
        if (new or again) and right.length_m > 2.0 * _AFTER_START_M:
            yield _Wanted(SignKind.SPEED_LIMIT, right, _AFTER_START_M, _driving(lanes), speed_mps)


def _sources(net: SumoNet) -> dict[str, set[str]]:
    """Edge → edges outside junctions that driving lanes lead from to it."""
    sources: dict[str, set[str]] = defaultdict(set)
    for lane in net.lanes.values():
        if lane.kind is not LaneKind.DRIVING or lane.junction:
            continue
        ahead = list(lane.successors)
        while ahead:
            follower = net.lanes[ahead.pop()]
            if follower.junction:
                ahead.extend(follower.successors)
            else:
                sources[follower.edge].add(lane.edge)
    return sources


def _arms(net: SumoNet) -> Counter[str]:
    """Junction → how many others it is joined to."""
    joined = {frozenset(ends) for ends in net.edge_ends.values()}
    return Counter(junction for ends in joined for junction in ends)


def _driving(lanes: Sequence[Lane]) -> tuple[str, ...]:
    return tuple(lane.id for lane in lanes if lane.kind is LaneKind.DRIVING)


def _speed_mps(lanes: Sequence[Lane]) -> float:
    return max(lane.speed_mps for lane in lanes if lane.kind is LaneKind.DRIVING)


def _off_the_road(wanted: Sequence[_Wanted], layout: Layout, curb_side: float) -> Iterator[Sign]:
    """Each sign at the first place beside its lane, on the right (1) or left (-1), where it can stand."""
    if not wanted:
        return
    lines = Polylines.of([sign.lane.centerline_m for sign in wanted])
    place = lines.parameter(np.arange(len(wanted)), np.array([sign.s_m for sign in wanted]))
    heading = lines.headings(place)
    outward = curb_side * np.column_stack([heading[:, 1], -heading[:, 0], np.zeros(len(wanted))])
    beside_m = np.add.outer([sign.lane.width_m / 2.0 for sign in wanted], _BESIDE_M)
    feet_m = lines.values(place)[:, None] + beside_m[..., None] * outward[:, None]
    free = _fit_to_stand(feet_m, lines.values(place), layout)
    yaws_rad = np.arctan2(-heading[:, 1], -heading[:, 0]).tolist()
    for row, first in enumerate(np.argmax(free, axis=1).tolist()):
        if free[row, first]:
            sign = wanted[row]
            yield Sign(sign.kind, feet_m[row, first], yaws_rad[row], sign.lanes, sign.speed_mps)


def _fit_to_stand(feet_m: Float64Array, lanes_m: Float64Array, layout: Layout) -> BoolArray:
    """(N, K) whether (N, K, 3) places are off the road and, beside (N, 3) lanes on structures, on a sidewalk."""
    feet = np.asarray(feet_m.reshape(-1, 3), np.float64)
    on_road = _touched(feet, layout.strips_of(*ROAD_KINDS, LaneKind.SHOULDER)).reshape(feet_m.shape[:2])
    carried = [strip for strip in layout.strips if strip.level > 0]
    aloft = _touched(lanes_m, carried)
    on_deck = _touched(feet, [strip for strip in carried if strip.kind is LaneKind.SIDEWALK])
    return ~on_road & (~aloft[:, None] | on_deck.reshape(feet_m.shape[:2]))


def _touched(places_m: Float64Array, strips: Sequence[Strip]) -> BoolArray:
    """(N,) whether (N, 3) places are on one of some strips, or hardly beside it."""
    tree = shapely.STRtree(strip_polygons(strips))
    points = np.asarray(shapely.points(places_m[:, :2]), object)
    place, strip = tree.query(points, predicate="dwithin", distance=_CLEAR_M)
    low_m, high_m = (np.array([end(each.center_m[:, 2]) for each in strips], np.float64) for end in (np.min, np.max))
    height_m = places_m[place, 2]
    touched = np.zeros(len(places_m), bool)
    near = (height_m > low_m[strip] - _SAME_HEIGHT_M) & (height_m < high_m[strip] + _SAME_HEIGHT_M)
    touched[place[near]] = True
    return touched
