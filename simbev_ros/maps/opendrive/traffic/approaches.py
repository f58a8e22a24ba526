"""From the lanes that a signal is for, to the lanes that traffic waits on, and to those of the traffic net."""

from collections.abc import Collection, Iterable, Mapping

import numpy as np

from simbev_ros.maps.opendrive.lane_shapes import LaneShape
from simbev_ros.maps.opendrive.links import OTHER, LaneLinks
from simbev_ros.maps.opendrive.reading.document import Contact, Document, LaneKey

_MOST_ROADS = 8


class Approaches:
    """Follows lanes back out of junctions, or on to where they enter one."""

    def __init__(self, document: Document, shapes: Mapping[LaneKey, LaneShape], links: LaneLinks) -> None:
        self._roads, self._shapes, self._links = document.roads, shapes, links

    def of(self, lanes: Iterable[LaneKey]) -> tuple[LaneKey, ...]:
        """The lanes at whose end traffic waits to drive on some lanes, or to leave them for a junction."""
        found: dict[LaneKey, None] = {}
        for key in lanes:
            if self._roads[key.road].junction:
                found |= dict.fromkeys(self._before(key))
            else:
                found[self._last(key)] = None
        return tuple(key for key in found if key in self._shapes)

    def exit(self, key: LaneKey) -> Contact:
        """The end of a lane where traffic leaves it."""
        return "end" if self._shapes[key].runs_forward else "start"

    def heading_rad(self, key: LaneKey) -> float:
        """Direction of the traffic at the end of a lane."""
        shape = self._shapes[key]
        step_m = np.diff((shape.inner_m + shape.outer_m)[[-2, -1] if shape.runs_forward else [1, 0], :2], axis=0)[0]
        return float(np.arctan2(step_m[1], step_m[0]))

    def _before(self, key: LaneKey) -> Collection[LaneKey]:
        """The lanes outside the junction from which a lane inside is reached."""
        found: dict[LaneKey, None] = {}
        waiting = {key}
        for _ in range(_MOST_ROADS):
            entered = {
                before
                for inside in sorted(waiting)
                if inside in self._shapes
                for before, _ in self._links.touching(inside, OTHER[self.exit(inside)])
            }
            outside = (before for before in sorted(entered) if not self._roads[before.road].junction)
            found |= dict.fromkeys(before for before in outside if before in self._shapes)
            waiting = {before for before in entered if self._roads[before.road].junction}
        return found

    def _last(self, key: LaneKey) -> LaneKey:
        """The lane of the last section that a lane leads to on its road."""
        seen = {key}
        while key in self._shapes:
            following = self._links.touching(key, self.exit(key))
            onward = [after for after, _ in following if after.road == key.road and after in self._shapes]
            if not onward or onward[0] in seen:
                break
            key = onward[0]
            seen.add(key)
        return key
