"""Finds the lanes on which traffic waits, given the OpenDRIVE lanes that a signal applies to."""

from collections.abc import Collection, Iterable, Mapping

import numpy as np

from simbev_ros.maps.opendrive.lane_shapes import LaneShape
from simbev_ros.maps.opendrive.links import OTHER_END, LaneLinks
from simbev_ros.maps.opendrive.reading.document import Contact, Document, LaneKey

_MAX_JUNCTION_ROADS = 8


class Approaches:
    """Follows lanes back out of junctions, or forward to the end of their road."""

    def __init__(self, document: Document, shapes: Mapping[LaneKey, LaneShape], links: LaneLinks) -> None:
        self._roads, self._shapes, self._links = document.roads, shapes, links

    def waiting_lanes(self, lanes: Iterable[LaneKey]) -> tuple[LaneKey, ...]:
        """The lanes where traffic waits before it enters the given lanes or leaves them for a junction."""
        found: dict[LaneKey, None] = {}
        for key in lanes:
            if self._roads[key.road].junction:
                found |= dict.fromkeys(self._lanes_before_junction(key))
            else:
                found[self._last_on_road(key)] = None
        return tuple(key for key in found if key in self._shapes)

    def exit_end(self, key: LaneKey) -> Contact:
        """The end of a lane at which traffic leaves it."""
        return "end" if self._shapes[key].runs_forward else "start"

    def heading_rad(self, key: LaneKey) -> float:
        """Driving direction at the end of a lane."""
        shape = self._shapes[key]
        step_m = np.diff((shape.inner_m + shape.outer_m)[[-2, -1] if shape.runs_forward else [1, 0], :2], axis=0)[0]
        return float(np.arctan2(step_m[1], step_m[0]))

    def _lanes_before_junction(self, key: LaneKey) -> Collection[LaneKey]:
        """The lanes outside the junction from which a lane inside it is reached."""
        found: dict[LaneKey, None] = {}
        pending = {key}
        for _ in range(_MAX_JUNCTION_ROADS):
            entered = {
                before
                for inside in sorted(pending)
                if inside in self._shapes
                for before, _ in self._links.touching(inside, OTHER_END[self.exit_end(inside)])
            }
            outside = (before for before in sorted(entered) if not self._roads[before.road].junction)
            found |= dict.fromkeys(before for before in outside if before in self._shapes)
            pending = {before for before in entered if self._roads[before.road].junction}
        return found

    def _last_on_road(self, key: LaneKey) -> LaneKey:
        """The lane of the last section that a lane leads to on its road."""
        seen = {key}
        while key in self._shapes:
            following = self._links.touching(key, self.exit_end(key))
            onward = [after for after, _ in following if after.road == key.road and after in self._shapes]
            if not onward or onward[0] in seen:
                break
            key = onward[0]
            seen.add(key)
        return key
