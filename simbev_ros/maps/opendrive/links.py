"""Which lane leads to which: along a road from section to section, from road to road, and through junctions."""

from collections.abc import Collection, Iterator, Sequence
from itertools import pairwise

from simbev_ros.maps.opendrive.reading.document import Connection, Contact, Document, LaneKey, Road, RoadEnd, Section

OTHER: dict[Contact, Contact] = {"start": "end", "end": "start"}
"""The other end."""

_LaneEnd = tuple[LaneKey, Contact]


class LaneLinks:
    """The links of all lanes of a file."""

    def __init__(self, document: Document) -> None:
        self._roads = document.roads
        self._next: dict[_LaneEnd, dict[_LaneEnd, None]] = {}
        for road in document.roads.values():
            for sections in (road.left, road.right):
                for before, after in pairwise(sections):
                    self._join(road, before, after)
            for contact in ("start", "end"):
                self._leave(road, contact)
        for connection in document.connections:
            self._connect(connection)

    def following(self, key: LaneKey, contact: Contact, kept: Collection[LaneKey]) -> tuple[LaneKey, ...]:
        """Lanes of ``kept`` that a lane leads to at one of its ends, those that are not kept being passed through."""
        found: dict[LaneKey, None] = {}
        seen: set[_LaneEnd] = set()
        waiting = [(key, contact)]
        while waiting:
            for entered, at in self._next.get(waiting.pop(), {}):
                leaving = (entered, OTHER[at])
                if entered in kept:
                    found[entered] = None
                elif leaving not in seen:
                    seen.add(leaving)
                    waiting.append(leaving)
        return tuple(found)

    def touching(self, key: LaneKey, contact: Contact) -> tuple[_LaneEnd, ...]:
        """Lanes, each with the end of it that touches one end of a lane."""
        return tuple(self._next.get((key, contact), {}))

    def _add(self, start: _LaneEnd, goal: _LaneEnd) -> None:
        self._next.setdefault(start, {})[goal] = None

    def _join(self, road: Road, before: Section, after: Section) -> None:
        """Two sections, one after the other."""
        numbers_before, numbers_after = ({lane.id for lane in section.lanes} for section in (before, after))
        for lane in before.lanes:
            for number in numbers_after.intersection(lane.successors):
                self._add(
                    (LaneKey(road.id, before.index, lane.id), "end"), (LaneKey(road.id, after.index, number), "start")
                )
        for lane in after.lanes:
            for number in numbers_before.intersection(lane.predecessors):
                self._add(
                    (LaneKey(road.id, after.index, lane.id), "start"), (LaneKey(road.id, before.index, number), "end")
                )

    def _leave(self, road: Road, contact: Contact) -> None:
        """From one end of a road to the road that it is linked to."""
        end = road.link(contact).end
        if end is None or end.road not in self._roads:
            return
        for sections in (road.left, road.right):
            for section in _at(sections, contact):
                for lane in section.lanes:
                    for number in lane.predecessors if contact == "start" else lane.successors:
                        for goal in self._lane_ends(end, number):
                            self._add((LaneKey(road.id, section.index, lane.id), contact), goal)

    def _connect(self, connection: Connection) -> None:
        """Through a junction."""
        incoming = self._roads[connection.incoming]
        entered = self._roads[connection.end.road]
        contact = _incoming_end(incoming, entered, connection.end.contact)
        pairs = connection.lanes
        if pairs is None:
            numbers = [lane.id for sections in (entered.left, entered.right) for s in sections for lane in s.lanes]
            pairs = tuple((number, number) for number in dict.fromkeys(numbers))
        for start_number, goal_number in pairs:
            for start in self._lane_ends(RoadEnd(incoming.id, contact), start_number):
                for goal in self._lane_ends(connection.end, goal_number):
                    self._add(start, goal)

    def _lane_ends(self, end: RoadEnd, number: int) -> Iterator[_LaneEnd]:
        """The lane of that number at one end of a road, if there is one."""
        road = self._roads[end.road]
        for section in _at(road.left if number > 0 else road.right, end.contact):
            if any(lane.id == number for lane in section.lanes):
                yield LaneKey(road.id, section.index, number), end.contact


def _at(sections: Sequence[Section], contact: Contact) -> Sequence[Section]:
    """The section at one end of a road, if there is any."""
    return sections[:1] if contact == "start" else sections[-1:]


def _incoming_end(incoming: Road, entered: Road, contact: Contact) -> Contact:
    """With which end the incoming road touches a junction: the connecting road knows, else its own links."""
    end = entered.link(contact).end
    if end is not None and end.road == incoming.id:
        return end.contact
    return "end" if incoming.successor.junction or not incoming.predecessor.junction else "start"
