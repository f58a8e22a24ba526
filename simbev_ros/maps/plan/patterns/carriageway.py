"""Builds one carriageway of a motorway as draft roads, with added lanes, lane drops, gores and layers along it."""

from dataclasses import dataclass, field
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.plan.curves import heading_at, point_at
from simbev_ros.maps.plan.draft import DraftRoad, RoadClass
from simbev_ros.maps.plan.lines import length_m, part

_WEAVING_M = 150.0  # an entry's and an exit's lane that are closer than this become one


class Interval(NamedTuple):
    """A stretch of a line; on closed lines the end may exceed the line's length."""

    start_m: float
    end_m: float
    value: int = 0


@dataclass
class Carriageway:
    """One direction of a motorway.

    Attributes:
        name: Prefix of its roads' names.
        kind: Cross-section outside all intervals: one way, its line at the left.
        line_m: (N, 2) left edge of the driving lanes, in driving direction; closed if it ends where it starts.
        added: Stretches with one more lane on the right instead of the shoulder.
        gores: Stretches without right shoulder, beside a ramp.
        lanes: Stretches with another number of lanes (``value``).
        layers: Stretches on another layer (``value``).
    """

    name: str
    kind: RoadClass
    line_m: Float64Array
    added: list[Interval] = field(default_factory=list)
    gores: list[Interval] = field(default_factory=list)
    lanes: list[Interval] = field(default_factory=list)
    layers: list[Interval] = field(default_factory=list)

    @property
    def closed(self) -> bool:
        """Whether it ends where it starts."""
        return bool(np.allclose(self.line_m[0], self.line_m[-1]))

    @property
    def length_m(self) -> float:
        """Length of its line."""
        return length_m(self.line_m)

    def pose(self, station_m: float) -> tuple[Float64Array, Float64Array]:
        """(2,) point and (2,) direction at a distance from the start."""
        station_m = station_m % self.length_m if self.closed else station_m
        return point_at(self.line_m, station_m), heading_at(self.line_m, station_m)

    def lanes_at(self, station_m: float) -> int:
        """Number of lanes at a distance from the start, not counting added ones."""
        return next((i.value for i in self.lanes if self._contains(i, station_m)), self.kind.lanes)

    def roads(self) -> list[DraftRoad]:
        """Split it into roads of constant cross-section and layer."""
        added = self._merge_intervals(self.added)
        cuts = sorted(
            {self._wrap_station(end) for i in (*added, *self.gores, *self.lanes, *self.layers) for end in i[:2]}
        )
        cuts = [cut for cut in cuts if self.closed or 1.0 < cut < self.length_m - 1.0]
        if self.closed:
            cuts = cuts or [0.0, self.length_m / 2.0]
            bounds = [*cuts, cuts[0] + self.length_m]
        else:
            bounds = [0.0, *cuts, self.length_m]
        return [
            DraftRoad(
                name=f"{self.name}.{index}",
                kind=self._kind_at((start + end) / 2.0, added),
                line_m=part(self.line_m, start, end),
                layer=next((i.value for i in self.layers if self._contains(i, (start + end) / 2.0)), 0),
            )
            for index, (start, end) in enumerate(pairwise(bounds))
        ]

    def _kind_at(self, station_m: float, added: list[Interval]) -> RoadClass:
        has_added_lane = any(self._contains(i, station_m) for i in added)
        without_shoulder = has_added_lane or any(self._contains(i, station_m) for i in self.gores)
        changes = {
            "lanes": self.lanes_at(station_m) + has_added_lane,
            "shoulder_m": 0.0 if without_shoulder else self.kind.shoulder_m,
        }
        return self.kind.model_copy(update=changes)

    def _merge_intervals(self, intervals: list[Interval]) -> list[Interval]:
        """Sort intervals, and merge those that overlap or nearly touch."""
        merged: list[Interval] = []
        for interval in sorted(intervals):
            if merged and interval.start_m < merged[-1].end_m + _WEAVING_M:
                merged[-1] = Interval(merged[-1].start_m, max(interval.end_m, merged[-1].end_m))
            else:
                merged.append(interval)
        if self.closed and len(merged) > 1 and merged[0].start_m + self.length_m < merged[-1].end_m + _WEAVING_M:
            merged[-1] = Interval(merged[-1].start_m, merged.pop(0).end_m + self.length_m)
        return merged

    def _wrap_station(self, station_m: float) -> float:
        return round(station_m % self.length_m if self.closed else station_m, 3)

    def _contains(self, interval: Interval, station_m: float) -> bool:
        if not self.closed:
            return interval.start_m <= station_m < interval.end_m
        return (station_m - interval.start_m) % self.length_m < interval.end_m - interval.start_m
