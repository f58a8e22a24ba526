"""Writes a plan with heights as SUMO's plain XML (nodes, edges, connections), the input of netconvert."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple
from xml.etree import ElementTree

from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.plan.draft import RoadClass
from simbev_ros.maps.plan.lines import offset_to_left, simplify
from simbev_ros.maps.plan.merges import lane_pairs
from simbev_ros.maps.plan.plan import Link, Plan
from simbev_ros.maps.roads.lane_kind import LaneKind

_MIN_RADIUS_M = 0.5
_MAX_CROSSING_KMH = 60.0
_MAX_CYCLING_KMH = 70.0
_ALLOWED = {LaneKind.SIDEWALK: {"allow": "pedestrian"}, LaneKind.BICYCLE: {"allow": "bicycle"}}
_CLOSED = {"disallow": "all"}
_ON_STREETS, _ON_FAST_ROADS = ({"disallow": classes} for classes in ("pedestrian", "pedestrian bicycle"))


class _LaneType(NamedTuple):
    kind: LaneKind
    width_m: float


def nodes_xml(plan: Plan, is_signalized: Sequence[bool], proj_string: str) -> str:
    """SUMO's node file as text; ``is_signalized``: (K,) whether each node has traffic lights."""
    root = ElementTree.Element("nodes")
    ElementTree.SubElement(
        root,
        "location",
        netOffset="0.00,0.00",
        convBoundary="0,0,0,0",
        origBoundary="0,0,0,0",
        projParameter=proj_string,
    )
    for index, (position_m, links, signalized) in enumerate(
        zip(plan.nodes_m, plan.links_at(), is_signalized, strict=True)
    ):
        x, y, z = position_m
        ElementTree.SubElement(
            root,
            "node",
            id=f"J{index}",
            x=f"{x:.3f}",
            y=f"{y:.3f}",
            z=f"{z:.3f}",
            type="traffic_light" if signalized else "priority",
            radius=f"{_radius_m(links):g}",
        )
    return ElementTree.tostring(root, encoding="unicode")


def _radius_m(links: Sequence[Link]) -> float:
    """Node radius: SUMO rounds the outer edge of the sidewalk, while the curb lies one sidewalk's width further out."""
    if len(links) < 3:
        return _MIN_RADIUS_M
    return max(min(link.road.kind.corner_radius_m - link.road.kind.sidewalk_m for link in links), _MIN_RADIUS_M)


def edges_xml(plan: Plan) -> str:
    """SUMO's edge file as text: one edge for each direction of each link."""
    root = ElementTree.Element("edges")
    for link in plan.links:
        for identifier, start, end, line_m in _directions(link):
            edge = ElementTree.SubElement(
                root,
                "edge",
                {
                    "id": identifier,
                    "from": f"J{start}",
                    "to": f"J{end}",
                    "numLanes": str(len(_lanes(link.road.kind))),
                    "priority": str(link.road.kind.priority),
                    "speed": f"{link.road.kind.speed_kmh / 3.6:.3f}",
                    "spreadType": "right",
                    "shape": " ".join(f"{x:.3f},{y:.3f},{z:.3f}" for x, y, z in simplify(line_m)),
                },
            )
            for index, lane in enumerate(_lanes(link.road.kind)):
                ElementTree.SubElement(
                    edge,
                    "lane",
                    {
                        "index": str(index),
                        "width": f"{lane.width_m:g}",
                        "type": lane.kind.value,
                        **_permissions(lane.kind, link.road.kind.speed_kmh),
                    },
                )
            if link.structure:
                ElementTree.SubElement(edge, "param", key="structure", value="bridge")
            if link.road.kind.verge:
                ElementTree.SubElement(edge, "param", key="verge", value="yes")
    return ElementTree.tostring(root, encoding="unicode")


def _permissions(lane: LaneKind, speed_kmh: float) -> dict[str, str]:
    """SUMO's permissions of a lane: no pedestrians on driving lanes, and no bicycles on those of fast roads."""
    if lane is LaneKind.DRIVING:
        return _ON_STREETS if speed_kmh <= _MAX_CYCLING_KMH else _ON_FAST_ROADS
    return _ALLOWED.get(lane, _CLOSED)


def connections_xml(plan: Plan, width_m: float) -> str:
    """SUMO's connection file as text: a crossing of each road with sidewalks at a junction, and lanes that begin."""
    root = ElementTree.Element("connections")
    for node, links in enumerate(plan.links_at()):
        for link in _crossed(links):
            crossed = {"node": f"J{node}", "edges": f"{link.id} -{link.id}", "width": f"{width_m:g}"}
            ElementTree.SubElement(root, "crossing", {**crossed, "priority": "true"})
        first = {link.id: _first_driving(link.road.kind) for link in links}
        for pair in lane_pairs(node, links):
            lanes = {
                "fromLane": str(first[pair.incoming] + pair.incoming_lane),
                "toLane": str(first[pair.outgoing] + pair.outgoing_lane),
            }
            ElementTree.SubElement(root, "connection", {"from": pair.incoming, "to": pair.outgoing, **lanes})
    return ElementTree.tostring(root, encoding="unicode")


def _crossed(links: Sequence[Link]) -> Sequence[Link]:
    """Roads with a pedestrian crossing at a junction; only one where a footpath ends beside a road."""
    if len(links) < 3:
        return ()
    crossed = [link for link in links if _has_crossings(link.road.kind)]
    return crossed[:1] if sum(link.road.kind.lanes > 0 for link in links) == 2 else crossed


def _has_crossings(kind: RoadClass) -> bool:
    return kind.sidewalk_m > 0.0 and not (kind.verge or kind.one_way) and kind.speed_kmh <= _MAX_CROSSING_KMH


def _first_driving(kind: RoadClass) -> int:
    """Index of the rightmost driving lane; 0 for footpaths."""
    return next((index for index, lane in enumerate(_lanes(kind)) if lane.kind is LaneKind.DRIVING), 0)


def _directions(link: Link) -> Iterator[tuple[str, int, int, Float64Array]]:
    """Id, start node, end node and left border of each direction of a link."""
    if link.road.kind.one_way:
        yield link.id, link.start, link.end, offset_to_left(link.line_m, _left_of_line_m(link.road.kind))
    else:
        yield link.id, link.start, link.end, link.line_m
        yield f"-{link.id}", link.end, link.start, link.line_m[::-1]


def _left_of_line_m(kind: RoadClass) -> float:
    """Distance by which a one-way road extends to the left of its line."""
    return kind.left_shoulder_m + (0.0 if kind.line_at == "left" else kind.lanes * kind.lane_width_m / 2.0)


def _lanes(kind: RoadClass) -> list[_LaneType]:
    """Lanes of one direction, from right to left."""
    inner_m = (LaneKind.SHOULDER, kind.left_shoulder_m) if kind.one_way else (LaneKind.MEDIAN, kind.median_m / 2.0)
    cross_section = [
        (LaneKind.SIDEWALK, kind.sidewalk_m),
        (LaneKind.SHOULDER, kind.shoulder_m),
        (LaneKind.PARKING, kind.parking_m),
        (LaneKind.BICYCLE, kind.bicycle_m),
        *[(LaneKind.DRIVING, kind.lane_width_m)] * kind.lanes,
        inner_m,
    ]
    return [_LaneType(lane, width_m) for lane, width_m in cross_section if width_m > 0.0]
