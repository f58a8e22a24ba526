"""Places stop, yield and speed limit signs by rule, for maps without signs of their own.

An approach that gives way has its sign beside its stop or yield line. Speed limit signs stand where the limit starts to
apply, and are repeated on long roads after a junction.
"""

from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from simbev_ros.foundation.types import BoolArray, Float64Array
from simbev_ros.maps.network import Lane, paths_beyond
from simbev_ros.maps.roads.lane_kind import PAVED_KINDS, LaneKind
from simbev_ros.maps.roads.layout import Layout, Sign, SignKind, Strip
from simbev_ros.maps.roads.polylines import Polylines
from simbev_ros.maps.roads.surface import strip_polygons
from simbev_ros.maps.sumo.net import SumoNet
from simbev_ros.maps.sumo.right_of_way import minor_approaches

_POST_OFFSETS_M = (
    0.7,
    1.5,
    2.5,
    3.5,
    4.5,
    5.5,
)  # candidate distances from the lane's edge to the post: the first one off all roads is taken
_DISTANCE_TO_END_M = 1.0
_DISTANCE_FROM_START_M = 12.0
_REPEAT_MIN_LENGTH_M = 250.0
_SPEED_TOLERANCE_MPS = 0.3
_MIN_LANE_M = 5.0
_HEIGHT_TOLERANCE_M = 2.0
_CLEARANCE_M = 0.3


@dataclass(frozen=True, slots=True)
class _SignRequest:
    """A sign to be placed beside a lane, ``s_m`` from its start."""

    kind: SignKind
    lane: Lane
    s_m: float
    lanes: tuple[str, ...]
    speed_mps: float = 0.0


def place_signs(net: SumoNet, layout: Layout) -> tuple[Sign, ...]:
    """Place signs by rule on the roads of a net.

    Args:
        net: Right of way and speed limits.
        layout: Ground geometry of the lanes; a sign without a free position beside its lane is left out.
    """
    edges: dict[str, list[Lane]] = defaultdict(list)
    for lane in net.lanes.values():
        if not lane.junction and lane.kind is not LaneKind.SIDEWALK and lane.length_m > _MIN_LANE_M:
            edges[lane.edge].append(lane)
    driven = {
        edge: sorted(lanes, key=lambda lane: lane.index)
        for edge, lanes in edges.items()
        if any(lane.kind is LaneKind.DRIVING for lane in lanes)
    }
    curb_side = -1.0 if net.left_hand else 1.0
    return tuple(_placed_off_road([*_priority_signs(net, driven), *_speed_signs(net, driven)], layout, curb_side))


def _priority_signs(net: SumoNet, edges: Mapping[str, list[Lane]]) -> Iterator[_SignRequest]:
    """One sign for each approach that gives way."""
    for edge, kind in minor_approaches(net).items():
        if edge in edges:
            right = edges[edge][0]
            yield _SignRequest(kind, right, right.length_m - _DISTANCE_TO_END_M, _driving(edges[edge]))


def _speed_signs(net: SumoNet, edges: Mapping[str, list[Lane]]) -> Iterator[_SignRequest]:
    """Signs where a speed limit starts to apply, and repetitions after junctions."""
    sources, arms = _sources(net), _arms(net)
    for edge, lanes in edges.items():
        right, speed_mps = lanes[0], _speed_mps(lanes)
        previous_mps = [_speed_mps(edges[source]) for source in sources[edge] if source in edges]
        is_new = not previous_mps or any(
            abs(other_mps - speed_mps) > _SPEED_TOLERANCE_MPS for other_mps in previous_mps
        )
        is_repeated = right.length_m > _REPEAT_MIN_LENGTH_M and arms[net.edge_ends[edge][0]] > 2
        if (is_new or is_repeated) and right.length_m > 2.0 * _DISTANCE_FROM_START_M:
            yield _SignRequest(SignKind.SPEED_LIMIT, right, _DISTANCE_FROM_START_M, _driving(lanes), speed_mps)


def _sources(net: SumoNet) -> dict[str, set[str]]:
    """Edge → edges outside junctions whose driving lanes lead to it."""
    sources: dict[str, set[str]] = defaultdict(set)
    for lane in net.lanes.values():
        if lane.kind is not LaneKind.DRIVING or lane.junction:
            continue
        for *_, following in paths_beyond(lane, net.lanes):
            sources[net.lanes[following].edge].add(lane.edge)
    return sources


def _arms(net: SumoNet) -> Counter[str]:
    """Junction → number of other junctions that it is joined to."""
    joined_pairs = {frozenset(ends) for ends in net.edge_ends.values()}
    return Counter(junction for ends in joined_pairs for junction in ends)


def _driving(lanes: Sequence[Lane]) -> tuple[str, ...]:
    return tuple(lane.id for lane in lanes if lane.kind is LaneKind.DRIVING)


def _speed_mps(lanes: Sequence[Lane]) -> float:
    return max(lane.speed_mps for lane in lanes if lane.kind is LaneKind.DRIVING)


def _placed_off_road(requests: Sequence[_SignRequest], layout: Layout, curb_side: float) -> Iterator[Sign]:
    """Each sign at the first free position beside its lane, on the right (``curb_side`` 1) or left (-1)."""
    if not requests:
        return
    lines = Polylines.from_lines([sign.lane.centerline_m for sign in requests])
    parameter = lines.parameter(np.arange(len(requests)), np.array([sign.s_m for sign in requests]))
    heading = lines.headings(parameter)
    outward = curb_side * np.column_stack([heading[:, 1], -heading[:, 0], np.zeros(len(requests))])
    beside_m = np.add.outer([sign.lane.width_m / 2.0 for sign in requests], _POST_OFFSETS_M)
    feet_m = lines.values(parameter)[:, None] + beside_m[..., None] * outward[:, None]
    free = _is_free(feet_m, lines.values(parameter), layout)
    yaws_rad = np.arctan2(-heading[:, 1], -heading[:, 0]).tolist()
    for row, first in enumerate(np.argmax(free, axis=1).tolist()):
        if free[row, first]:
            sign = requests[row]
            yield Sign(sign.kind, feet_m[row, first], yaws_rad[row], sign.lanes, sign.speed_mps)


def _is_free(feet_m: Float64Array, lanes_m: Float64Array, layout: Layout) -> BoolArray:
    """(N, K) whether (N, K, 3) positions are off the road, and on a sidewalk beside (N, 3) lanes on structures."""
    feet = np.asarray(feet_m.reshape(-1, 3), np.float64)
    on_road = _touches_strip(feet, layout.strips_of(*PAVED_KINDS)).reshape(feet_m.shape[:2])
    elevated = [strip for strip in layout.strips if strip.level > 0]
    on_structure = _touches_strip(lanes_m, elevated)
    on_deck = _touches_strip(feet, [strip for strip in elevated if strip.kind is LaneKind.SIDEWALK])
    return ~on_road & (~on_structure[:, None] | on_deck.reshape(feet_m.shape[:2]))


def _touches_strip(positions_m: Float64Array, strips: Sequence[Strip]) -> BoolArray:
    """(N,) whether (N, 3) positions are on one of the strips, or within the clearance of one."""
    tree = shapely.STRtree(strip_polygons(strips))
    points = np.asarray(shapely.points(positions_m[:, :2]), object)
    position, strip = tree.query(points, predicate="dwithin", distance=_CLEARANCE_M)
    low_m, high_m = (np.array([end(each.center_m[:, 2]) for each in strips], np.float64) for end in (np.min, np.max))
    height_m = positions_m[position, 2]
    touches = np.zeros(len(positions_m), bool)
    near = (height_m > low_m[strip] - _HEIGHT_TOLERANCE_M) & (height_m < high_m[strip] + _HEIGHT_TOLERANCE_M)
    touches[position[near]] = True
    return touches
