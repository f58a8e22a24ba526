"""Reads the regulatory elements: which lanelets wait, stop or yield at their end, and for which lights and signs."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
import shapely

from simbev_ros.maps.findings import Findings
from simbev_ros.maps.lanelet2.document import LaneletMap, Linestring, Regulation
from simbev_ros.maps.lanelet2.junctions import Junctions
from simbev_ros.maps.lanelet2.shapes import LaneletShape
from simbev_ros.maps.lanelet2.tables import SIGN_KINDS, SPEED_SIGN, SPEED_UNITS_MPS, WITHOUT_EFFECT
from simbev_ros.maps.lanelet2.tags import parse_speed_mps
from simbev_ros.maps.lanelet2.topology import Topology
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import Crosswalk, SignKind
from simbev_ros.maps.roads.surface import crosswalk_polygons

_KNOWN = ("traffic_light", "traffic_sign", "speed_limit", "right_of_way", "all_way_stop", "speed_bump")


@dataclass(frozen=True, slots=True, eq=False)
class Rule:
    """A rule of traffic, applied to lanelets.

    Attributes:
        meaning: ``traffic_light``, ``stop``, ``yield`` or ``speed_limit``.
        lanelets: Ids of the lanelets that it applies to: at their end, speed limits from their start.
        posts: Its traffic lights or signs.
        stop_lines: Lines at which traffic waits.
        speed_mps: Value of speed limits, else 0.
    """

    meaning: str
    lanelets: tuple[str, ...]
    posts: tuple[Linestring, ...]
    stop_lines: tuple[Linestring, ...]
    speed_mps: float = 0.0


def with_speed_limits(source: LaneletMap) -> LaneletMap:
    """The map with the speed limits of regulatory elements as tags of the lanelets that refer to them."""
    limits = {name: _speed_mps(rule) for name, rule in source.regulations.items() if rule.subtype != "traffic_light"}
    limits = {name: speed_mps for name, speed_mps in limits.items() if speed_mps}
    lanelets = {
        name: replace(lanelet, tags=MappingProxyType({**lanelet.tags, "speed_limit": f"{min(stated):.4f} m/s"}))
        if (stated := [limits[rule] for rule in lanelet.regulations if rule in limits])
        else lanelet
        for name, lanelet in source.lanelets.items()
    }
    return replace(source, lanelets=lanelets)


def rules_of(source: LaneletMap, junctions: Junctions, notes: Findings) -> tuple[Rule, ...]:
    """All rules of a map that apply to lanelets for vehicles, in the order of the file."""
    shapes = junctions.topology.shapes
    users: dict[str, list[str]] = {}
    for name, shape in shapes.items():
        for reference in dict.fromkeys(shape.lanelet.regulations):
            if reference in source.regulations:
                users.setdefault(reference, []).append(name)
            else:
                notes.left_out("a lanelet refers to a regulatory element that is missing", shape.lanelet.element)
    found = []
    for name, regulation in source.regulations.items():
        if regulation.subtype not in _KNOWN:
            known = (
                "without effect on this simulation" if regulation.subtype in WITHOUT_EFFECT else "of unknown subtype"
            )
            notes.left_out(f"a regulatory element {known} is ignored", regulation.element, regulation.subtype[:30])
            continue
        found += [rule for rule in _rules(regulation, users.get(name, ()), junctions) if rule.lanelets]
    return tuple(found)


def waiting_at_crosswalks(crosswalks: Sequence[Crosswalk], topology: Topology) -> set[str]:
    """Lanelets with a crosswalk at their end: on each lane the one that ends nearest to it.

    Pedestrians cross where edges of the SUMO net meet, so that one has to end there.
    """
    shapes = [shape for shape in topology.shapes.values() if shape.kind is LaneKind.DRIVING]
    areas = crosswalk_polygons(crosswalks)
    rows, crossed = shapely.STRtree([shape.polygon for shape in shapes]).query(areas, predicate="intersects")
    found: set[str] = set()
    for row, number in zip(rows.tolist(), crossed.tolist(), strict=True):
        shape = shapes[number]
        gaps_m = np.linalg.norm(shape.center_m[[0, -1]] - crosswalks[row].outline_m.mean(axis=0), axis=1)
        found.update(topology.preceding[shape.id] if gaps_m[0] < gaps_m[1] else (shape.id,))
    return found


def _rules(regulation: Regulation, users: Iterable[str], junctions: Junctions) -> Iterator[Rule]:
    """Yield the rules of one regulatory element that lanelets refer to."""
    posts = regulation.lines.get("refers", ())
    stop_lines = regulation.lines.get("ref_line", ())
    yielding = [name for name in regulation.lanelets.get("yield", ()) if name in junctions.topology.shapes]
    if regulation.subtype == "right_of_way":
        first = set(_approaches(regulation.lanelets.get("right_of_way", ()), (), junctions))
        giving_way = (name for name in _approaches(yielding, stop_lines, junctions) if name not in first)
        kinds = {SIGN_KINDS.get(post.tags.get("subtype", "").lower()) for post in posts}
        meaning = "stop" if SignKind.STOP in kinds else "yield"
        yield Rule(meaning, tuple(giving_way), posts, stop_lines)
    elif regulation.subtype == "all_way_stop":
        yield Rule("stop", _approaches(yielding or users, stop_lines, junctions), posts, stop_lines)
    elif regulation.subtype == "traffic_light":
        yield Rule("traffic_light", _approaches(users, stop_lines, junctions), posts, stop_lines)
    else:
        yield from _sign_rules(posts, tuple(users), stop_lines, junctions)


def _sign_rules(
    posts: Iterable[Linestring], users: tuple[str, ...], stop_lines: tuple[Linestring, ...], junctions: Junctions
) -> Iterator[Rule]:
    """Yield one rule for each traffic sign of known meaning."""
    for post in posts:
        code = post.tags.get("subtype", "").lower()
        if code in SIGN_KINDS:
            yield Rule(SIGN_KINDS[code].value, _approaches(users, stop_lines, junctions), (post,), stop_lines)
        elif _sign_speed_mps(code):
            yield Rule("speed_limit", users, (post,), (), _sign_speed_mps(code))


def _approaches(names: Iterable[str], stop_lines: Iterable[Linestring], junctions: Junctions) -> tuple[str, ...]:
    """The lanelets where traffic waits, at their ends, before it passes or leaves the given ones.

    A rule of a lanelet with a stop line at its start holds up the lanelets before it.
    """
    topology = junctions.topology
    found: dict[str, None] = {}
    for name in names:
        if name not in topology.shapes:
            continue
        before = topology.preceding[name]
        if name not in junctions.by_lanelet and before and _is_at_start(name, stop_lines, topology.shapes):
            found |= {approach: None for each in before for approach in junctions.approaches(each)}
        else:
            found |= dict.fromkeys(junctions.approaches(name))
    return tuple(found)


def _is_at_start(name: str, stop_lines: Iterable[Linestring], shapes: Mapping[str, LaneletShape]) -> bool:
    """Whether the nearest stop line of a lanelet is nearer to its start than to its end."""
    ends_m = shapes[name].center_m[[0, -1], :2]
    gaps_m = [np.linalg.norm(ends_m - line.points_m[[0, -1], :2].mean(axis=0), axis=1) for line in stop_lines]
    if not gaps_m:
        return False
    nearest = min(gaps_m, key=lambda gap_m: float(gap_m.min()))
    return bool(nearest[0] < nearest[1])


def _speed_mps(regulation: Regulation) -> float:
    """Speed limit that a regulatory element sets; 0 if none."""
    signs = [_sign_speed_mps(post.tags.get("subtype", "").lower()) for post in regulation.lines.get("refers", ())]
    stated = parse_speed_mps(regulation.tags.get("sign_type", "")) or _sign_speed_mps(
        regulation.tags.get("sign_type", "").lower()
    )
    return max(stated, *signs, 0.0)


def _sign_speed_mps(code: str) -> float:
    """Value of a speed limit sign by its code; 0 if it is none."""
    match = SPEED_SIGN.match(code)
    return 0.0 if match is None else float(match[1]) * SPEED_UNITS_MPS["mph" if code.startswith("us") else "km/h"]
