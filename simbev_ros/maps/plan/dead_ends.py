"""Adds turning circles at the dead ends of a plan, so that every lane has a successor."""

from dataclasses import replace

import numpy as np

from simbev_ros.foundation.errors import InputError
from simbev_ros.maps.plan.draft import DraftRoad, RoadClass
from simbev_ros.maps.plan.lines import arc, length_m, part
from simbev_ros.maps.plan.plan import Link, Plan, heading_from

_RADIUS_M = 11.0
_LANE_M = 4.5
_SPEED_KMH = 20.0


def add_turning_circles(plan: Plan) -> Plan:
    """Add a one-way circle around each node at which a road ends; footpaths may end anywhere.

    Raises:
        InputError: A one-way road leads nowhere, or a dead end is too short for a circle.
    """
    nodes_m, links = list(plan.nodes_m), {link.id: link for link in plan.links}
    for node, touching in enumerate(plan.links_at()):
        if len(touching) != 1 or touching[0].road.kind.lanes == 0:
            continue
        link = links[touching[0].id]
        if link.road.kind.one_way:
            raise InputError(f"road {link.road.name}: a one-way road must lead from road to road")
        if length_m(link.line_m) < 2.0 * _RADIUS_M:
            raise InputError(f"road {link.road.name}: its dead end is shorter than {2.0 * _RADIUS_M:g} m")
        center_m = plan.nodes_m[node]
        shortened = _shorten(link, node)
        entry_m = shortened.line_m[0 if link.start == node else -1]
        nodes_m[node] = entry_m
        nodes_m.append(2.0 * center_m - entry_m)
        links[link.id] = shortened
        for half in _circle(shortened, node, len(nodes_m) - 1, center_m):
            links[half.id] = half
    return Plan(np.array(nodes_m), tuple(links.values()), plan.notes)


def _shorten(link: Link, node: int) -> Link:
    """Cut off the part of a link within the circle at a node."""
    whole_m = length_m(link.line_m)
    kept = (_RADIUS_M, whole_m) if link.start == node else (0.0, whole_m - _RADIUS_M)
    return replace(link, line_m=part(link.line_m, *kept))


def _circle(link: Link, node: int, far_node: int, center_m: np.ndarray) -> list[Link]:
    """Both halves of the circle, counter-clockwise from the node and back to it."""
    outward = heading_from(link, node)
    entry_rad = float(np.arctan2(outward[1], outward[0]))
    kind = RoadClass(
        one_way=True,
        lane_width_m=_LANE_M,
        speed_kmh=_SPEED_KMH,
        sidewalk_m=link.road.kind.sidewalk_m,
        verge=link.road.kind.verge,
        priority=link.road.kind.priority,
        corner_radius_m=link.road.kind.corner_radius_m,
    )
    halves = []
    for name, start, end, start_rad in (
        ("out", node, far_node, entry_rad),
        ("back", far_node, node, entry_rad + np.pi),
    ):
        line_m = arc(center_m, _RADIUS_M, start_rad, np.pi)
        road = DraftRoad(f"{link.id}.{'start' if link.start == node else 'end'}.{name}", kind, line_m, link.road.layer)
        halves.append(Link(road.name, road, start, end, line_m))
    return halves
