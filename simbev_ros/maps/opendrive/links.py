"""Links between lanes of an OpenDRIVE document: from section to section, from road to road, and through junctions."""

from collections.abc import Collection, Iterator, Sequence
from itertools import pairwise

from simbev_ros.maps.opendrive.reading.document import Connection, Contact, Document, LaneKey, Road, RoadEnd, Section

OTHER_END: dict[Contact, Contact] = {"start": "end", "end": "start"}
"""Maps each end to the opposite end."""

_LaneEnd = tuple[LaneKey, Contact]


class LaneLinks:
    """The links of all lanes of a file, by lane and end."""

    def __init__(self, document: Document) -> None:
        self._roads = document.roads
        self._next: dict[_LaneEnd, dict[_LaneEnd, None]] = {}
        for road in document.roads.values():
            for sections in (road.left, road.right):
                for before, after in pairwise(sections):
                    self._link_sections(road, before, after)
            for contact in ("start", "end"):
                self._link_road_end(road, contact)
        for connection in document.connections:
            self._link_junction(connection)

    def following(self, key: LaneKey, contact: Contact, kept: Collection[LaneKey]) -> tuple[LaneKey, ...]:
        """Lanes of ``kept`` that a lane leads to at one of its ends; lanes that are not kept are passed through."""
        found: dict[LaneKey, None] = {}
        seen: set[_LaneEnd] = set()
        pending = [(key, contact)]
        while pending:
            for entered, at in self._next.get(pending.pop(), {}):
                leaving = (entered, OTHER_END[at])
                if entered in kept:
                    found[entered] = None
                elif leaving not in seen:
                    seen.add(leaving)
                    pending.append(leaving)
        return tuple(found)

    def touching(self, key: LaneKey, contact: Contact) -> tuple[_LaneEnd, ...]:
        """Lanes that touch one end of a lane, each with the touching end."""
        return tuple(self._next.get((key, contact), {}))

    def _add_link(self, start: _LaneEnd, target: _LaneEnd) -> None:
        self._next.setdefault(start, {})[target] = None

    def _link_sections(self, road: Road, before: Section, after: Section) -> None:
        """Link the lanes of two consecutive sections."""
        ids_before, ids_after = ({lane.id for lane in section.lanes} for section in (before, after))
        for lane in before.lanes:
            for lane_id in ids_after.intersection(lane.successors):
                self._add_link(
                    (LaneKey(road.id, before.index, lane.id), "end"), (LaneKey(road.id, after.index, lane_id), "start")
                )
        for lane in after.lanes:
            for lane_id in ids_before.intersection(lane.predecessors):
                self._add_link(
                    (LaneKey(road.id, after.index, lane.id), "start"), (LaneKey(road.id, before.index, lane_id), "end")
                )

    def _link_road_end(self, road: Road, contact: Contact) -> None:
        """Link the lanes at one end of a road to those of the road that it is linked to."""
        end = road.link(contact).end
        if end is None or end.road not in self._roads:
            return
        for sections in (road.left, road.right):
            for section in _end_section(sections, contact):
                for lane in section.lanes:
                    for lane_id in lane.predecessors if contact == "start" else lane.successors:
                        for target in self._lane_ends(end, lane_id):
                            self._add_link((LaneKey(road.id, section.index, lane.id), contact), target)

    def _link_junction(self, connection: Connection) -> None:
        """Link the lanes of a junction connection."""
        incoming = self._roads[connection.incoming]
        entered = self._roads[connection.end.road]
        contact = _incoming_end(incoming, entered, connection.end.contact)
        pairs = connection.lanes
        if pairs is None:
            lane_ids = [lane.id for sections in (entered.left, entered.right) for s in sections for lane in s.lanes]
            pairs = tuple((lane_id, lane_id) for lane_id in dict.fromkeys(lane_ids))
        for source_id, target_id in pairs:
            for start in self._lane_ends(RoadEnd(incoming.id, contact), source_id):
                for target in self._lane_ends(connection.end, target_id):
                    self._add_link(start, target)

    def _lane_ends(self, end: RoadEnd, lane_id: int) -> Iterator[_LaneEnd]:
        """The lane with this id at one end of a road, if there is one."""
        road = self._roads[end.road]
        for section in _end_section(road.left if lane_id > 0 else road.right, end.contact):
            if any(lane.id == lane_id for lane in section.lanes):
                yield LaneKey(road.id, section.index, lane_id), end.contact


def _end_section(sections: Sequence[Section], contact: Contact) -> Sequence[Section]:
    """The section at one end of a road, as a sequence of at most one."""
    return sections[:1] if contact == "start" else sections[-1:]


def _incoming_end(incoming: Road, entered: Road, contact: Contact) -> Contact:
    """The end with which the incoming road touches a junction: as the connecting road says, else by its own links."""
    end = entered.link(contact).end
    if end is not None and end.road == incoming.id:
        return end.contact
    return "end" if incoming.successor.junction or not incoming.predecessor.junction else "start"
