"""One carriageway of a motorway: a line with auxiliary lanes, lane drops, gores and layers along it, as draft roads."""

from dataclasses import dataclass, field
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from simbev_ros.maps.plan.curves import heading, place_m
from simbev_ros.maps.plan.draft import DraftRoad, RoadClass
from simbev_ros.maps.plan.lines import length_m, part
from simbev_ros.types import Float64Array

_WEAVING_M = 150.0  # an entry's and an exit's lane that are nearer to each other become one


class Interval(NamedTuple):
    """A stretch of a line; on closed lines the end may be past the line's length."""

    start_m: float
    end_m: float
    value: int = 0


@dataclass
class Carriageway:
    """One direction of a motorway.

    Attributes:
        name: Prefix of its roads' names.
        kind: Cross-section where nothing is added: one way, its line at the left.
        line_m: (N, 2) left edge of the driving lanes, in driving direction; closed if it ends where it starts.
        added: Stretches with one more lane on the right, in place of the shoulder.
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
        """Of its line."""
        return length_m(self.line_m)

    def pose(self, at_m: float) -> tuple[Float64Array, Float64Array]:
        """(2,) place and (2,) direction at a distance from the start."""
        at_m = at_m % self.length_m if self.closed else at_m
        return place_m(self.line_m, at_m), heading(self.line_m, at_m)

    def lanes_at(self, at_m: float) -> int:
        """Number of lanes, without added ones."""
        return next((i.value for i in self.lanes if self._inside(i, at_m)), self.kind.lanes)

    def roads(self) -> list[DraftRoad]:
        """Its stretches of one cross-section and layer each."""
        added = self._merged(self.added)
        cuts = sorted({self._wrapped(end) for i in (*added, *self.gores, *self.lanes, *self.layers) for end in i[:2]})
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
                layer=next((i.value for i in self.layers if self._inside(i, (start + end) / 2.0)), 0),
            )
            for index, (start, end) in enumerate(pairwise(bounds))
        ]

    def _kind_at(self, at_m: float, added: list[Interval]) -> RoadClass:
        more = any(self._inside(i, at_m) for i in added)
        bare = more or any(self._inside(i, at_m) for i in self.gores)
        changes = {"lanes": self.lanes_at(at_m) + more, "shoulder_m": 0.0 if bare else self.kind.shoulder_m}
        return self.kind.model_copy(update=changes)

    def _merged(self, intervals: list[Interval]) -> list[Interval]:
        """Intervals in order, those joined that overlap or nearly touch."""
        merged: list[Interval] = []
        for interval in sorted(intervals):
            if merged and interval.start_m < merged[-1].end_m + _WEAVING_M:
                merged[-1] = Interval(merged[-1].start_m, max(interval.end_m, merged[-1].end_m))
            else:
                merged.append(interval)
        if self.closed and len(merged) > 1 and merged[0].start_m + self.length_m < merged[-1].end_m + _WEAVING_M:
            merged[-1] = Interval(merged[-1].start_m, merged.pop(0).end_m + self.length_m)
        return merged

    def _wrapped(self, at_m: float) -> float:
        return round(at_m % self.length_m if self.closed else at_m, 3)

    def _inside(self, interval: Interval, at_m: float) -> bool:
        if not self.closed:
            return interval.start_m <= at_m < interval.end_m
        return (at_m - interval.start_m) % self.length_m < interval.end_m - interval.start_m
