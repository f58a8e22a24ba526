"""The motorway pattern of a town recipe: two carriageways along a line, and crossing roads with or without ramps.

A motorway may cross itself, as in a figure of eight; an open one ends as a two-way road with the same number of lanes.
"""

from itertools import pairwise
from typing import Literal

import numpy as np
import shapely
from pydantic import Field

from simbev_ros.config.base import Model
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.plan.curves import offset_to_right, point_at, round_corners
from simbev_ros.maps.plan.draft import Draft, DraftRoad, RoadClass
from simbev_ros.maps.plan.lines import length_m, part, stations_m
from simbev_ros.maps.plan.patterns.carriageway import Carriageway, Interval
from simbev_ros.maps.plan.patterns.interchange import add_half_diamond, crossing_stations_m
from simbev_ros.maps.plan.road_class import NamedRoadClass

_TERMINAL_M = 85.0  # distance from a carriageway's outer edge to the junction of ramps and road
_BRIDGE_M = 30.0  # distance from a carriageway's outer edge to the end of the bridge over it
_TAPER_M = 150.0  # length over which the median of an open motorway narrows to zero


class CrossingRoad(Model):
    """A two-way road that crosses the motorway once."""

    road: NamedRoadClass
    points_m: tuple[tuple[float, float], ...] = Field(min_length=2)
    radius_m: float = Field(80.0, gt=0, description="radius of its curves")
    over: bool = Field(True, description="passes over the motorway; else the motorway passes over it")
    ramps: bool = True


class LaneChange(Model):
    """A stretch of both carriageways with a different number of lanes."""

    start_m: float = Field(ge=0, description="along the motorway's line")
    end_m: float = Field(gt=0)
    lanes: int = Field(ge=1, le=6)


class MotorwayClass(Model):
    """The cross-section of a dual carriageway."""

    lanes: int = Field(3, ge=1, le=5, description="per direction")
    lane_width_m: float = Field(3.5, ge=3, le=5)
    speed_kmh: float = Field(110.0, gt=0, le=140)
    median_m: float = Field(8.0, ge=2, le=60, description="between the lanes of both directions")
    shoulder_m: float = Field(
        3.5, ge=0, le=5, description="as wide as a lane, so that added lanes do not widen the road"
    )
    left_shoulder_m: float = Field(1.0, ge=0, le=3)

    @property
    def carriageway(self) -> RoadClass:
        """Cross-section of one of its carriageways."""
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
    radius_m: float = Field(400.0, ge=60, description="radius of its curves")
    closed: bool = False
    lane_changes: tuple[LaneChange, ...] = ()
    crossing_roads: tuple[CrossingRoad, ...] = ()


def draw_motorway(pattern: Motorway, draft: Draft, rng: np.random.Generator) -> None:
    """Append the motorway, the roads that cross it, and its ramps; does not use ``rng``."""
    axis_m = round_corners(np.array(pattern.points_m), pattern.radius_m, pattern.closed)
    motorway = DualCarriageway(pattern.name, pattern, axis_m, pattern.lane_changes)
    for index, crossing in enumerate(pattern.crossing_roads):
        line_m = round_corners(np.array(crossing.points_m), crossing.radius_m)
        name = f"{pattern.name}.road{index}"
        motorway.add_crossing_road(draft, name, crossing.road, line_m, over=crossing.over, ramps=crossing.ramps)
    motorway.append_to(draft)


class DualCarriageway:
    """Both carriageways of a motorway along an (N, 2) axis."""

    def __init__(
        self, name: str, kind: MotorwayClass, axis_m: Float64Array, lane_changes: tuple[LaneChange, ...] = ()
    ) -> None:
        self.axis_m = axis_m
        self._kind = kind
        self._stations_m = stations_m(axis_m)
        self._closed = bool(np.allclose(axis_m[0], axis_m[-1]))
        offset_m = self._offset_m()
        forward_m, backward_m = (offset_to_right(axis_m, side * offset_m, self._closed) for side in (1.0, -1.0))
        self.carriageways = (
            Carriageway(f"{name}.forward", kind.carriageway, forward_m),
            Carriageway(f"{name}.backward", kind.carriageway, backward_m[::-1]),
        )
        for change in lane_changes:
            for carriageway, interval in zip(
                self.carriageways, self._intervals(change.start_m, change.end_m), strict=True
            ):
                carriageway.lanes.append(interval._replace(value=change.lanes))
        self._raise_at_own_crossing()

    @property
    def half_width_m(self) -> float:
        """Distance from the axis to the outer edge of the lanes."""
        return self._kind.median_m / 2.0 + self._kind.lanes * self._kind.lane_width_m

    def add_crossing_road(
        self, draft: Draft, name: str, kind: RoadClass, line_m: Float64Array, *, over: bool, ramps: bool
    ) -> None:
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
            self._raise_layer(axis_at_m - reach_m, axis_at_m + reach_m)
        bounds_m = [0.0, *cuts_m, length_m(line_m)]
        for piece, (start_m, end_m) in enumerate(pairwise(bounds_m)):
            if end_m - start_m > 1.0:
                layer = 1 if over and piece == 1 else 0
                draft.roads.append(DraftRoad(f"{name}.{piece}", kind, part(line_m, start_m, end_m), layer))
        if ramps and kind.lanes > 1:
            draft.signals_m.extend(point_at(line_m, cut_m) for cut_m in cuts_m)
        if ramps:
            self._add_ramps(draft, name, axis_at_m, [point_at(line_m, cut_m) for cut_m in cuts_m])

    def append_to(self, draft: Draft) -> None:
        """Append both carriageways to a draft, after all crossing and joining roads were added."""
        for carriageway in self.carriageways:
            draft.roads.extend(carriageway.roads())

    def _add_ramps(self, draft: Draft, name: str, axis_at_m: float, terminals_m: list[Float64Array]) -> None:
        """Add two half diamonds, each at the terminal on the right of its carriageway."""
        for carriageway, (crossing_m, _, _) in zip(
            self.carriageways, self._intervals(axis_at_m, axis_at_m), strict=True
        ):
            point, along = carriageway.pose(crossing_m)
            right = np.array([along[1], -along[0]])
            terminal_m = max(terminals_m, key=lambda terminal: float((terminal - point) @ right))
            add_half_diamond(
                draft, carriageway, crossing_m, f"{name}.{carriageway.name.rsplit('.', 1)[-1]}", terminal_m
            )

    def _offset_m(self) -> Float64Array:
        """(N,) distance of the lanes' left edges from the axis; 0 at the ends of an open motorway."""
        half_m = self._kind.median_m / 2.0
        if self._closed:
            return np.full(len(self.axis_m), half_m)
        end_m = np.minimum(self._stations_m, self._stations_m[-1] - self._stations_m)
        fraction = np.clip(end_m / _TAPER_M, 0.0, 1.0)
        return np.asarray(half_m * fraction**2 * (3.0 - 2.0 * fraction))

    def _intervals(self, start_m: float, end_m: float) -> tuple[Interval, Interval]:
        """A stretch of the axis as a stretch of each carriageway."""
        total_m = self._stations_m[-1]
        ends = []
        for carriageway, reverse in zip(self.carriageways, (False, True), strict=True):
            along_m = stations_m(carriageway.line_m)[:: -1 if reverse else 1]
            bounds_m = (end_m, start_m) if reverse else (start_m, end_m)
            if self._closed:
                bounds_m = (bounds_m[0] % total_m, bounds_m[1] % total_m)
            first_m, last_m = (float(np.interp(at_m, self._stations_m, along_m)) for at_m in bounds_m)
            ends.append(Interval(first_m, last_m + carriageway.length_m * (last_m < first_m)))
        return ends[0], ends[1]

    def _raise_layer(self, start_m: float, end_m: float) -> None:
        """Put a stretch of the motorway one layer higher."""
        for carriageway, interval in zip(self.carriageways, self._intervals(start_m, end_m), strict=True):
            carriageway.layers.append(interval._replace(value=1))

    def _raise_at_own_crossing(self) -> None:
        """Raise the later part of the motorway over the earlier one where it crosses itself."""
        segments = np.asarray(shapely.linestrings(np.stack([self.axis_m[:-1], self.axis_m[1:]], axis=1)))
        earlier, later = shapely.STRtree(segments).query(segments, predicate="crosses")
        reach_m = 2.0 * self.half_width_m + _BRIDGE_M
        for index in np.unique(np.maximum(earlier, later)).tolist():
            center_m = float(np.mean(self._stations_m[index : index + 2]))
            self._raise_layer(center_m - reach_m, center_m + reach_m)
