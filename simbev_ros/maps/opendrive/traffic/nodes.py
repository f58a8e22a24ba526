"""Names the nodes of the SUMO net: junctions, and the positions where roads, or stretches of a road, meet."""

import re

from simbev_ros.maps.opendrive.reading.document import Document, Road

_END_TOLERANCE_M = 0.2
_UNSAFE = re.compile(r"[^A-Za-z0-9.]")


class Nodes:
    """Node names as a union-find structure: several positions become one node when they are joined.

    Attributes:
        safe_ids: Road id → the same id in characters that SUMO allows.
    """

    def __init__(self, document: Document) -> None:
        self._parent: dict[str, str] = {}
        self.safe_ids = {
            road_id: f"{number}+" if _UNSAFE.search(road_id) else road_id
            for number, road_id in enumerate(document.roads)
        }

    def node_at(self, road: Road, s_m: float) -> str:
        """The node at a position on a road; at the road's ends it is joined with the link target."""
        contact = "start" if s_m < _END_TOLERANCE_M else "end" if s_m > road.length_m - _END_TOLERANCE_M else ""
        if contact == "":
            return f"{self.safe_ids[road.id]}@{s_m:.1f}"
        own = f"{self.safe_ids[road.id]}.{contact}"
        link = road.predecessor if contact == "start" else road.successor
        if link.junction:
            self.join(own, f"J{_UNSAFE.sub('.', link.junction)}")
        elif link.end is not None and link.end.road in self.safe_ids:
            self.join(own, f"{self.safe_ids[link.end.road]}.{link.end.contact}")
        return own

    def resolve(self, node: str) -> str:
        """The name of the joined node that a node belongs to: a junction's name if it has one."""
        while (parent := self._parent.get(node, node)) != node:
            node = parent
        return node

    def join(self, node_a: str, node_b: str) -> None:
        """Join two nodes to one."""
        first, second = sorted(
            (self.resolve(node_a), self.resolve(node_b)), key=lambda resolve: (resolve[0] != "J", resolve)
        )
        if first != second:
            self._parent[second] = first
