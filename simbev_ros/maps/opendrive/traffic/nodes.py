"""Nodes of the traffic net: junctions, and the places where roads, or stretches of a road, meet."""

import re

from simbev_ros.maps.opendrive.reading.document import Document, Road

_TOUCHES_M = 0.2
_UNSAFE = re.compile(r"[^A-Za-z0-9.]")


class Nodes:
    """Names of nodes; several places become one node when they are joined.

    Attributes:
        safe: Road id → the same as SUMO allows it in ids.
    """

    def __init__(self, document: Document) -> None:
        self._parent: dict[str, str] = {}
        self.safe = {
            road_id: f"{number}+" if _UNSAFE.search(road_id) else road_id
            for number, road_id in enumerate(document.roads)
        }

    def at(self, road: Road, s_m: float) -> str:
        """The node at a place on a road; at its ends it is joined with what the file links it to."""
        contact = "start" if s_m < _TOUCHES_M else "end" if s_m > road.length_m - _TOUCHES_M else ""
        if contact == "":
            return f"{self.safe[road.id]}@{s_m:.1f}"
        own = f"{self.safe[road.id]}.{contact}"
        link = road.predecessor if contact == "start" else road.successor
        if link.junction:
            self.join(own, f"J{_UNSAFE.sub('.', link.junction)}")
        elif link.end is not None and link.end.road in self.safe:
            self.join(own, f"{self.safe[link.end.road]}.{link.end.contact}")
        return own

    def name(self, node: str) -> str:
        """The name of the node that a place belongs to: a junction's if there is one."""
        while (parent := self._parent.get(node, node)) != node:
            node = parent
        return node

    def join(self, node_a: str, node_b: str) -> None:
        """Make one of two."""
        first, second = sorted((self.name(node_a), self.name(node_b)), key=lambda name: (name[0] != "J", name))
        if first != second:
            self._parent[second] = first
