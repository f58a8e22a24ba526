"""The motorway pattern: two carriageways along a line, and roads that cross it above or below, with or without ramps.

A motorway may cross itself, as in a figure of eight; an open one ends as a two-way road of as many lanes.
"""

from itertools import pairwise
from typing import Literal

import numpy as np
import shapely
from pydantic import Field

from simbev_ros.config.base import Model
from simbev_ros.errors import InputError
from simbev_ros.maps.plan.curves import place_m, right_of, rounded
from simbev_ros.maps.plan.draft import Draft, DraftRoad, RoadClass
from simbev_ros.maps.plan.lines import length_m, part, stations_m
from simbev_ros.maps.plan.patterns.carriageway import Carriageway, Interval
from simbev_ros.maps.plan.patterns.interchange import crossing_stations_m, half_diamond
from simbev_ros.maps.plan.road_class import NamedRoadClass
from simbev_ros.types import Float64Array

_TERMINAL_M = 85.0  # from a carriageway's outer edge to the junction of ramps and road
_BRIDGE_M = 30.0  # from a carriageway's outer edge to the end of what passes over it
_TAPER_M = 150.0  # in which the median of an open motorway vanishes


class CrossingRoad(Model):
    """A two-way road that crosses the motorway once."""

    road: NamedRoadClass
    points_m: tuple[tuple[float, float], ...] = Field(min_length=2)
    radius_m: float = Field(80.0, gt=0, description="of its curves")
    over: bool = Field(True, description="passes over the motorway; else the motorway passes over it")
    ramps: bool = True


class LaneChange(Model):
    """A stretch of both carriageways with another number of lanes."""

    start_m: float = Field(ge=0, description="along the motorway's line")
    end_m: float = Field(gt=0)
    lanes: int = Field(ge=1, le=6)


class MotorwayClass(Model):
    """The cross-section of a dual carriageway."""

    lanes: int = Field(3, ge=1, le=5, description="per direction")
    lane_width_m: float = Field(3.5, ge=3, le=5)
    speed_kmh: float = Field(110.0, gt=0, le=140)
    median_m: float = Field(8.0, ge=2, le=60, description="between the lanes of both directions")
    shoulder_m: float = Field(3.5, ge=0, le=5, description="as wide as a lane: so the road is, with lanes added")
    left_shoulder_m: float = Field(1.0, ge=0, le=3)

    @property
    def carriageway(self) -> RoadClass:
        """One of its carriageways."""
        return RoadClass(
            one_way=True,
            line_at="left",
            lanes=self.lanes,
            lane_width_m=self.lane_width_m,
            speed_kmh=self.speed_kmh,
            shoulder_m=self.shoulder_m,
            left_shoulder_m=self.left_shoulder_m,
            corner_radius_m=1.0,
            priority=12,
        )


class Motorway(MotorwayClass):
    """A dual carriageway along a line."""

    pattern: Literal["motorway"]
    name: str = "motorway"
    points_m: tuple[tuple[float, float], ...] = Field(min_length=2, description="corners of its line")
    radius_m: float = Field(400.0, ge=60, description="of its curves")
    closed: bool = False
    lane_changes: tuple[LaneChange, ...] = ()
    crossing_roads: tuple[CrossingRoad, ...] = ()


def draw(pattern: Motorway, draft: Draft, rng: np.random.Generator) -> None:
    """Append the motorway, the roads that cross it, and its ramps; nothing of it is random."""
    axis_m = rounded(np.array(pattern.points_m), pattern.radius_m, pattern.closed)
    motorway = DualCarriageway(pattern.name, pattern, axis_m, pattern.lane_changes)
    for index, crossing in enumerate(pattern.crossing_roads):
        line_m = rounded(np.array(crossing.points_m), crossing.radius_m)
        name = f"{pattern.name}.road{index}"
        motorway.cross(draft, name, crossing.road, line_m, over=crossing.over, ramps=crossing.ramps)
    motorway.append_to(draft)


class DualCarriageway:
    """Both carriageways of a motorway along an (N, 2) line, its axis."""

    def __init__(
        self, name: str, kind: MotorwayClass, axis_m: Float64Array, lane_changes: tuple[LaneChange, ...] = ()
    ) -> None:
        self.axis_m = axis_m
        self._kind = kind
        self._stations_m = stations_m(axis_m)
        self._closed = bool(np.allclose(axis_m[0], axis_m[-1]))
        offset_m = self._offset_m()
        forward_m, backward_m = (right_of(axis_m, side * offset_m, self._closed) for side in (1.0, -1.0))
        self.ways = (
            Carriageway(f"{name}.forward", kind.carriageway, forward_m),
            Carriageway(f"{name}.backward", kind.carriageway, backward_m[::-1]),
        )
        for change in lane_changes:
            for way, interval in zip(self.ways, self._intervals(change.start_m, change.end_m), strict=True):
                way.lanes.append(interval._replace(value=change.lanes))
        self._raise_at_own_crossing()

    @property
    def half_width_m(self) -> float:
        """From the axis to the outer edge of the lanes."""
        return self._kind.median_m / 2.0 + self._kind.lanes * self._kind.lane_width_m

    def cross(self, draft: Draft, name: str, kind: RoadClass, line_m: Float64Array, *, over: bool, ramps: bool) -> None:
        """Append a road that crosses the axis once, divided where its layer changes or ramps meet it.

        Raises:
            InputError: It does not cross the axis.
        """
        crossing = crossing_stations_m(self.axis_m, line_m)
        if crossing is None:
            raise InputError(f"road {name}: does not cross its motorway")
        axis_at_m, road_at_m = crossing
        beside_m = self.half_width_m + (_TERMINAL_M if ramps else _BRIDGE_M)
        cuts_m = (road_at_m - beside_m, road_at_m + beside_m)
        if not over:
            reach_m = kind.lanes * kind.lane_width_m + kind.median_m / 2.0 + kind.sidewalk_m + _BRIDGE_M
            self._lift(axis_at_m - reach_m, axis_at_m + reach_m)
        bounds_m = [0.0, *cuts_m, length_m(line_m)]
        for piece, (start_m, end_m) in enumerate(pairwise(bounds_m)):
            if end_m - start_m > 1.0:
                layer = 1 if over and piece == 1 else 0
                draft.roads.append(DraftRoad(f"{name}.{piece}", kind, part(line_m, start_m, end_m), layer))
        if ramps and kind.lanes > 1:
            draft.signals_m.extend(place_m(line_m, cut_m) for cut_m in cuts_m)
        if ramps:
            self._add_ramps(draft, name, axis_at_m, [place_m(line_m, cut_m) for cut_m in cuts_m])

    def append_to(self, draft: Draft) -> None:
        """Append both carriageways, once all that crosses or joins them is known."""
        for way in self.ways:
            draft.roads.extend(way.roads())

    def _add_ramps(self, draft: Draft, name: str, axis_at_m: float, terminals_m: list[Float64Array]) -> None:
        """Two half diamonds, each at the terminal on the right of its carriageway."""
        for way, (crossing_m, _, _) in zip(self.ways, self._intervals(axis_at_m, axis_at_m), strict=True):
            place, along = way.pose(crossing_m)
            right = np.array([along[1], -along[0]])
            terminal_m = max(terminals_m, key=lambda terminal: float((terminal - place) @ right))
            half_diamond(draft, way, crossing_m, f"{name}.{way.name.rsplit('.', 1)[-1]}", terminal_m)

    def _offset_m(self) -> Float64Array:
        """(N,) distance of the lanes' left edges from the axis; none at the ends of an open motorway."""
        half_m = self._kind.median_m / 2.0
        if self._closed:
            return np.full(len(self.axis_m), half_m)
        end_m = np.minimum(self._stations_m, self._stations_m[-1] - self._stations_m)
        share = np.clip(end_m / _TAPER_M, 0.0, 1.0)
        return np.asarray(half_m * share**2 * (3.0 - 2.0 * share))

    def _intervals(self, start_m: float, end_m: float) -> tuple[Interval, Interval]:
        """A stretch of the axis as a stretch of either carriageway."""
        total_m = self._stations_m[-1]
        ends = []
        for way, reverse in zip(self.ways, (False, True), strict=True):
            along_m = stations_m(way.line_m)[:: -1 if reverse else 1]
            bounds_m = (end_m, start_m) if reverse else (start_m, end_m)
            if self._closed:
                bounds_m = (bounds_m[0] % total_m, bounds_m[1] % total_m)
            first_m, last_m = (float(np.interp(at_m, self._stations_m, along_m)) for at_m in bounds_m)
            ends.append(Interval(first_m, last_m + way.length_m * (last_m < first_m)))
        return ends[0], ends[1]

    def _lift(self, start_m: float, end_m: float) -> None:
        """Put a stretch of the motorway a layer higher."""
        for way, interval in zip(self.ways, self._intervals(start_m, end_m), strict=True):
            way.layers.append(interval._replace(value=1))

    def _raise_at_own_crossing(self) -> None:
        """Where the motorway crosses itself, its later part passes over the earlier one."""
        segments = np.asarray(shapely.linestrings(np.stack([self.axis_m[:-1], self.axis_m[1:]], axis=1)))
        earlier, later = shapely.STRtree(segments).query(segments, predicate="crosses")
        reach_m = 2.0 * self.half_width_m + _BRIDGE_M
        for index in np.unique(np.maximum(earlier, later)).tolist():
            center_m = float(np.mean(self._stations_m[index : index + 2]))
            self._lift(center_m - reach_m, center_m + reach_m)
