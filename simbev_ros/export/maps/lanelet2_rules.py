"""Finds which lanelets wait for which lights, signs and other lanelets, as Lanelet2 describes that, and which turn."""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import shapely

from simbev_ros.maps.lane_links import halting_strips, strips_at
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.roads.lane_strips import LaneStrips
from simbev_ros.maps.roads.layout import SignKind, Strip
from simbev_ros.maps.roads.surface import strip_polygons

_BEFORE_END_M = 0.5
_CLEARANCE_M = 0.3
_STRAIGHT_RAD = np.radians(30.0)


class Rule(NamedTuple):
    """A regulatory element: the lanelets with it, rows of the lights or signs, and of at most one stop line.

    Of ``right_of_way``, the lanelets give way to those in ``first``.
    """

    subtype: str
    lanelets: tuple[str, ...]
    posts: Sequence[int]
    stop_lines: tuple[int, ...]
    first: tuple[str, ...] = ()


def rules_of(network: RoadNetwork, lanelets: Sequence[Strip]) -> Iterator[Rule]:
    """Yield the regulatory elements of a map, for its lanelets for vehicles."""
    layout = network.layout
    driven = LaneStrips(replace(layout, strips=tuple(lanelets)))
    line_of: dict[str, tuple[int, ...]] = {}
    for row, halting in enumerate(halting_strips(layout.stop_lines, driven) if layout.stop_lines else ()):
        line_of |= dict.fromkeys(halting, (row,))
    mounts = {tuple(place.head_m.tolist()): place.lanes for place in layout.signal_places}
    lanes_of = [mounts.get(tuple(signal.position_m.tolist()), (signal.lane,)) for signal in network.signals]
    posts = [("traffic_light", row, _lanelets_at(network, lanes, driven)) for row, lanes in enumerate(lanes_of)]
    posts += [
        (sign.kind.value, row, _lanelets_at(network, sign.lanes, driven))
        for row, sign in enumerate(layout.signs)
        if sign.kind is not SignKind.SPEED_LIMIT
    ]
    groups: dict[tuple[str, tuple[int, ...], tuple[str, ...]], list[int]] = defaultdict(list)
    for meaning, post, names in posts:
        for line in dict.fromkeys(line_of.get(name, ()) for name in names):
            groups[meaning, line, tuple(name for name in names if line_of.get(name, ()) == line)].append(post)
    posted = {line for _, line, _ in groups}
    for line in dict.fromkeys(line_of.values()):
        if line not in posted and layout.stop_lines[line[0]].yields:
            groups[SignKind.YIELD, line, tuple(name for name in line_of if line_of[name] == line)] = []
    inside = {strip.id: strip for strip in lanelets if strip.junction and not strip.continues}
    beyond = {key: _paths(key[2], driven, inside) for key in groups if key[0] != "traffic_light"}
    minor = {name for names in beyond.values() for name in names}
    for key, rows in groups.items():
        meaning, line, users = key
        crossed = _crossed(beyond.get(key, ()), inside)
        if meaning == "traffic_light":
            yield Rule(meaning, users, rows, line)
        elif rows and (meaning != SignKind.YIELD or not crossed):
            yield Rule("traffic_sign", users, rows, line)
        if crossed:
            first = tuple(each for each in crossed if each not in minor) or crossed
            yield Rule("right_of_way", beyond[key], rows, line, first)


def _lanelets_at(network: RoadNetwork, lanes: Iterable[str], driven: LaneStrips) -> list[str]:
    """Lanelets at the ends of traffic lanes."""
    ends = [network.lanes[name] for name in lanes if name in network.lanes]
    positions = [(lane, lane.length_m - min(_BEFORE_END_M, lane.length_m / 2.0)) for lane in ends]
    return [name for name in dict.fromkeys(strips_at(positions, driven)) if name]


def _paths(names: Iterable[str], driven: LaneStrips, inside: Mapping[str, Strip]) -> tuple[str, ...]:
    """The lanelets inside junctions through which paths from some lead on, in that order."""
    pending, found = list(names), list[str]()
    for name in pending:
        after = [each for each in driven.by_lane[name].following if each in inside and each not in found]
        found += after
        pending += after
    return tuple(found)


def _crossed(names: Sequence[str], inside: Mapping[str, Strip]) -> tuple[str, ...]:
    """The lanelets inside the same junctions that cross or meet some."""
    ours = [inside[name] for name in names]
    junctions = {strip.junction for strip in ours}
    others = [strip for strip in inside.values() if strip.junction in junctions and strip.id not in names]
    areas, other_areas = (shapely.buffer(strip_polygons(strips), -_CLEARANCE_M) for strips in (ours, others))
    meets = shapely.intersects(areas[:, None], other_areas[None]).any(axis=0)
    return tuple(others[row].id for row in np.flatnonzero(meets))


def turns_of(lanelets: Sequence[Strip]) -> dict[str, str]:
    """Lanelet inside a junction → ``straight``, ``left`` or ``right``: the turn of its path through the junction."""
    inside = {strip.id: strip for strip in lanelets if strip.junction and not strip.continues}
    steps = {name: np.diff(strip.center_m[:, :2] @ [1.0, 1.0j])[[0, -1]] for name, strip in inside.items()}
    links = [(name, strip.following[0]) for name, strip in inside.items() if {*strip.following[:1]} & inside.keys()]
    for name, after in links:
        steps[name][1], steps[after][0] = steps[after][1], steps[name][0]
    turns_rad = {name: float(np.angle(end / start)) for name, (start, end) in steps.items()}
    return {
        name: "straight" if abs(turn_rad) < _STRAIGHT_RAD else "left" if turn_rad > 0.0 else "right"
        for name, turn_rad in turns_rad.items()
    }
