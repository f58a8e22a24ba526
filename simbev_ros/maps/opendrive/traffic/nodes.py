"""Names the nodes of the SUMO net: junctions, and the positions where roads, or stretches of a road, meet."""

import re

from simbev_ros.maps.lane_graph.joined_names import JoinedNames
from simbev_ros.maps.opendrive.reading.document import Document, Road

_END_TOLERANCE_M = 0.2
_UNSAFE = re.compile(r"[^A-Za-z0-9.]")


class Nodes(JoinedNames):
    """Node names: several positions become one node when they are joined, with a junction's name if it has one.

    Attributes:
        safe_ids: Road id → the same id in characters that SUMO allows.
    """

    def __init__(self, document: Document) -> None:
        super().__init__(lambda name: (name[0] != "J", name))
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
