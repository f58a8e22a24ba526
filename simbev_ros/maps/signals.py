"""Places traffic-light heads and poles: the net defines what is controlled, the map or a rule defines where heads hang.

A one-lane approach has a post at the near side, right of the stop line. A wider approach has a mast whose arm carries
one head above each lane. The mast stands at the far side, right of the street that continues straight on, or at the
near side if there is none. For left-hand traffic, posts and masts stand on the left.
"""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import accumulate

import numpy as np

from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.network import Lane, Signal, paths_beyond
from simbev_ros.maps.roads.elevation import Elevation
from simbev_ros.maps.roads.lane_kind import ROAD_KINDS, LaneKind
from simbev_ros.maps.roads.layout import Layout, SignalPlace
from simbev_ros.maps.sumo.net import ControlledLink, SumoNet

_CURB_TO_POLE_M = 0.6
_HEAD_BEFORE_POLE_M = 0.25
_POST_HEAD_HEIGHT_M = 3.0
_ARM_HEAD_HEIGHT_M = 5.6
_FAR_SIDE_SETBACK_M = 0.5
_INTO_JUNCTION_M = 0.7  # from the end of a parking lane onto the sidewalk there
_MAX_BEND_RAD = np.radians(30.0)
_STRAIGHTNESS = "sRLrltT"  # SUMO's direction codes, straightest first


def place_signals(net: SumoNet, layout: Layout) -> tuple[Signal, ...]:
    """Place one head at each mount that the map names, and one for each controlled driving lane without such a mount.

    A head shows the link of its straightest movement.

    Args:
        net: The SUMO net with its controlled links.
        layout: Ground heights, and the map's own signal mounts if it has any.

    Returns:
        Heads in ascending order of program and link.
    """
    main = _main_links(net.links)
    signals = [signal for mount in layout.signal_places for signal in _head_at(mount, main)]
    named = {lane for mount in layout.signal_places for lane in mount.lanes}
    approaches = _by_edge(net.lanes[lane_id] for lane_id in main if lane_id not in named)
    streets = _by_edge(lane for lane in net.lanes.values() if lane.kind is LaneKind.DRIVING)
    paved = _by_edge(lane for lane in net.lanes.values() if lane.kind in ROAD_KINDS)
    by_rule = [
        Signal(position_m, yaw_rad, pole_m, main[lane.id].programme, main[lane.id].link, lane.id)
        for approach in approaches.values()
        for lane, position_m, yaw_rad, pole_m in _head_poses(approach, net, streets, paved)
    ]
    signals += _snap_to_ground(by_rule, Elevation(layout)) if by_rule else []
    return tuple(sorted(signals, key=lambda signal: (signal.programme, signal.link)))


def shown_links(net: SumoNet, layout: Layout) -> dict[str, ControlledLink]:
    """Lane id → the link whose state the lane's first light shows; arguments as for ``place_signals``."""
    main = _main_links(net.links)
    shown: dict[str, ControlledLink] = {}
    for mount in layout.signal_places:
        lanes = [lane for lane in mount.lanes if lane in main]
        for lane in lanes:
            shown.setdefault(lane, min((main[each] for each in lanes), key=_straightness_key))
    return main | shown


def with_net_ids(signals: Iterable[Signal]) -> tuple[Signal, ...]:
    """Heads with the ids that netconvert gives their links in the OpenDRIVE file it makes of the net."""
    return tuple(replace(signal, opendrive_id=f"{signal.programme}_{signal.link}") for signal in signals)


def _by_edge(lanes: Iterable[Lane]) -> dict[str, list[Lane]]:
    """Lanes by edge, each edge's lanes ordered from the curb inward."""
    edges: dict[str, list[Lane]] = defaultdict(list)
    for lane in sorted(lanes, key=lambda lane: lane.index):
        edges[lane.edge].append(lane)
    return edges


def _head_at(mount: SignalPlace, main: Mapping[str, ControlledLink]) -> Iterator[Signal]:
    """The head at a mount, unless none of its lanes is controlled."""
    links = [main[lane] for lane in mount.lanes if lane in main]
    if links:
        link = min(links, key=_straightness_key)
        name = mount.opendrive_id
        yield Signal(mount.head_m, mount.yaw_rad, mount.foot_m, link.programme, link.link, link.lane, name)


def _snap_to_ground(signals: Sequence[Signal], elevation: Elevation) -> Iterator[Signal]:
    """Signals lifted so that their poles stand on the ground."""
    feet_m = np.array([signal.pole_m for signal in signals])
    levels = elevation.level_at(feet_m)
    for level in np.unique(levels).tolist():
        rows = np.flatnonzero(levels == level)
        lifts_m = elevation.height_m(feet_m[rows, :2], level) - feet_m[rows, 2]
        for row, lift_m in zip(rows.tolist(), lifts_m, strict=True):
            lift = np.array([0.0, 0.0, lift_m])
            yield replace(signals[row], position_m=signals[row].position_m + lift, pole_m=signals[row].pole_m + lift)


def _straightness_key(link: ControlledLink) -> tuple[int, int]:
    return _STRAIGHTNESS.index(link.direction), link.link


def _main_links(links: Sequence[ControlledLink]) -> dict[str, ControlledLink]:
    """Lane id → the link of the lane's straightest movement."""
    main: dict[str, ControlledLink] = {}
    for link in sorted(links, key=_straightness_key):
        main.setdefault(link.lane, link)
    return main


def _head_poses(
    approach: Sequence[Lane],
    net: SumoNet,
    streets: Mapping[str, Sequence[Lane]],
    paved: Mapping[str, Sequence[Lane]],
) -> Iterator[tuple[Lane, Float64Array, float, Float64Array]]:
    """Each lane of an approach (from the curb inward) with its head's position, the yaw of its lamps and its pole."""
    curb_side = -1.0 if net.left_hand else 1.0
    outermost, outside_m, parks = _outermost(approach[0], paved)
    curb_m, heading = _curb(outermost, -1, curb_side)
    curb_m = curb_m + _INTO_JUNCTION_M * parks * heading
    exit_lane = _straight_exit(approach, net.lanes, streets) if len(approach) > 1 else None
    if exit_lane is not None:
        outermost, outside_m, parks = _outermost(exit_lane, paved)
        curb_m, heading = _curb(outermost, 0, curb_side)
        curb_m = curb_m + (-_INTO_JUNCTION_M if parks else _FAR_SIDE_SETBACK_M) * heading
    inward = curb_side * np.array([-heading[1], heading[0], 0.0])
    pole_m = curb_m - _CURB_TO_POLE_M * inward
    yaw_rad = float(np.arctan2(-heading[1], -heading[0]))
    inner_borders_m = accumulate((lane.width_m for lane in approach[1:]), initial=outside_m + approach[0].width_m)
    for lane, inner_border_m in zip(approach, inner_borders_m, strict=True):
        foot_m = pole_m if len(approach) == 1 else curb_m + (inner_border_m - lane.width_m / 2.0) * inward
        height_m = _POST_HEAD_HEIGHT_M if len(approach) == 1 else _ARM_HEAD_HEIGHT_M
        yield lane, foot_m - _HEAD_BEFORE_POLE_M * heading + [0.0, 0.0, height_m], yaw_rad, pole_m


def _outermost(lane: Lane, paved: Mapping[str, Sequence[Lane]]) -> tuple[Lane, float, bool]:
    """The lane next to the curb beside a lane, its distance from that curb, and whether a parking lane ends there.

    Parking lanes end before junctions, where the sidewalk reaches the next lane.
    """
    outer = [each for each in paved[lane.edge] if each.index < lane.index]
    open_to_traffic = [each for each in outer if each.kind is not LaneKind.PARKING]
    outside_m = sum(each.width_m for each in open_to_traffic)
    return [*open_to_traffic, lane][0], outside_m, len(open_to_traffic) < len(outer)


def _curb(lane: Lane, end: int, side: float) -> tuple[Float64Array, Float64Array]:
    """(3,) border point of a lane and (3,) horizontal unit vector along it.

    Args:
        lane: The lane.
        end: Its start (0) or its end (-1).
        side: Its right (1) or left (-1) border.
    """
    heading = _heading(lane, end)
    return lane.centerline_m[end] + side * lane.width_m / 2.0 * np.array([heading[1], -heading[0], 0.0]), heading


def _heading(lane: Lane, end: int) -> Float64Array:
    """(3,) horizontal unit vector in driving direction, at a lane's start (``end`` 0) or end (-1)."""
    step_m = np.diff(lane.centerline_m, axis=0)[end] * [1.0, 1.0, 0.0]
    return step_m / np.linalg.norm(step_m)


def _straight_exit(
    approach: Sequence[Lane], lanes: Mapping[str, Lane], streets: Mapping[str, Sequence[Lane]]
) -> Lane | None:
    """The rightmost driving lane of the street that continues most nearly straight, or None if all streets turn off.

    Cycleways and other edges without a driving lane are not streets.
    """
    heading_in = _heading(approach[0], -1)
    beyond = [lanes[path[-1]] for start in approach for path in paths_beyond(start, lanes)]
    exits = {lane.edge: lane for lane in beyond if lane.edge in streets}
    bends_rad = {edge: float(np.arccos(np.clip(_heading(lane, 0) @ heading_in, -1, 1))) for edge, lane in exits.items()}
    straightest = min(bends_rad, key=lambda edge: bends_rad[edge], default=None)
    if straightest is None or bends_rad[straightest] > _MAX_BEND_RAD:
        return None
    return streets[straightest][0]
