"""Progress of a vehicle along its route, and the rule by which a drive ends, for the world and for referees alike.

A route may cross itself or pass a road twice, so a position belongs to the part of the route that is near the position
before it.
"""

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from simbev_ros.foundation.types import Float64Array
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.schema.scene.drive_spec import Command, DriveSpec, RouteSpec

STANDING_MPS = 0.1
"""Horizontal speed below which a vehicle stands still."""
_BACK_M, _AHEAD_M = 20.0, 60.0
"""Part of the route around the latest progress in which a position is looked for."""


@dataclass(frozen=True, slots=True)
class Progress:
    """Where a vehicle is on its route.

    Attributes:
        distance_m: Distance along the route of the point nearest to the vehicle.
        furthest_m: The greatest ``distance_m`` so far.
        lateral_m: Distance of the vehicle to the left of that point; negative to its right.
        offset_m: Distance from that point in plan view.
        row: Index of the last point of the route that the vehicle has reached.
        remaining_m: Distance along the route to the goal.
    """

    distance_m: float
    furthest_m: float
    lateral_m: float
    offset_m: float
    row: int
    remaining_m: float

    @property
    def completed(self) -> float:
        """Share of the route that has been driven, 0 to 1."""
        return self.furthest_m / (self.distance_m + self.remaining_m)


class RouteProgress:
    """Follows a vehicle along its route. Call ``advance_to`` with each position in the order of time."""

    def __init__(self, route: RouteSpec) -> None:
        """Start at the beginning of a route."""
        self._route, self._points_m = route, route.points_m[:, :2]
        self._stations_m = np.array(route.distance_m)
        self._distance_m = self._furthest_m = 0.0

    def advance_to(self, position_m: Float64Array) -> Progress:
        """Progress of a vehicle whose center is at (2,) or (3,) coordinates, map frame."""
        window_m = self._distance_m - _BACK_M, self._distance_m + _AHEAD_M
        first, last = np.searchsorted(self._stations_m, window_m).tolist()
        first, last = max(first - 1, 0), min(last, len(self._stations_m) - 1)
        start_m, step_m = self._points_m[first:last], np.diff(self._points_m[first : last + 1], axis=0)
        from_start_m = position_m[:2] - start_m
        square_m2 = np.einsum("ni,ni->n", step_m, step_m)
        share = np.clip(np.einsum("ni,ni->n", from_start_m, step_m) / square_m2, 0.0, 1.0)
        offset_m = np.linalg.norm(from_start_m - share[:, None] * step_m, axis=1)
        nearest = int(np.argmin(offset_m))
        length_m = math.sqrt(square_m2[nearest])
        cross = step_m[nearest, 0] * from_start_m[nearest, 1] - step_m[nearest, 1] * from_start_m[nearest, 0]
        row = first + nearest
        self._distance_m = float(self._stations_m[row] + share[nearest] * length_m)
        self._furthest_m = max(self._furthest_m, self._distance_m)
        return Progress(
            self._distance_m,
            self._furthest_m,
            float(cross) / length_m,
            float(offset_m[nearest]),
            row,
            self._route.length_m - self._distance_m,
        )

    def next_command(self, progress: Progress) -> tuple[Command, float]:
        """The present maneuver, or the next one ahead, and the distance to its beginning; at the end, to the goal."""
        commands = self._route.command
        for row in range(progress.row, len(commands)):
            if commands[row] is not Command.FOLLOW:
                return commands[row], max(float(self._stations_m[row]) - progress.distance_m, 0.0)
        return Command.FOLLOW, progress.remaining_m


class DriveEnd(StrEnum):
    """Why a drive ends before the last tick of its scene."""

    GOAL = "goal"
    STANDSTILL = "standstill"
    OFF_ROUTE = "off_route"
    TIMEOUT = "timeout"


class DriveRule:
    """Decides at each tick from 0 on whether a drive ends.

    Attributes:
        progress: Progress at the latest tick that ``end_at`` was asked for.
    """

    progress: Progress

    def __init__(self, drive: DriveSpec, tick_ns: int) -> None:
        """For a drive with ticks of this length."""
        self._drive, self._tick_s = drive, tick_ns / NS_PER_S
        self._route_progress = RouteProgress(drive.route)
        self._standing_ticks = 0

    def end_at(self, tick: int, position_m: Float64Array, speed_mps: float) -> tuple[DriveEnd, str] | None:
        """Why the drive ends with a tick, also in words; None: it goes on.

        Args:
            tick: The tick; each one from 0 on.
            position_m: (2,) or (3,) center of the vehicle, map frame.
            speed_mps: Its horizontal speed.
        """
        drive, progress = self._drive, self._route_progress.advance_to(position_m)
        self.progress = progress
        self._standing_ticks = self._standing_ticks + 1 if speed_mps < STANDING_MPS else 0
        at = f"{progress.distance_m:.1f} of {drive.route.length_m:.1f} m at tick {tick}"
        if progress.offset_m > drive.off_route_m:
            return DriveEnd.OFF_ROUTE, f"ego left its route by {progress.offset_m:.1f} m after {at}"
        if progress.remaining_m <= drive.goal_radius_m:
            return DriveEnd.GOAL, f"ego reached its goal after {at}"
        if self._standing_ticks * self._tick_s >= drive.standstill_s - 1e-9:
            return DriveEnd.STANDSTILL, f"ego stood still for {drive.standstill_s:g} s after {at}"
        if drive.timeout_s is not None and (tick + 1) * self._tick_s >= drive.timeout_s - 1e-9:
            return DriveEnd.TIMEOUT, f"ego did not reach its goal in {drive.timeout_s:g} s; it drove {at}"
        return None
