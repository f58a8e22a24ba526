"""Where the ego is along its route, and whether the drive is over."""

import numpy as np
import shapely

from simbev_ros.evaluation.driving.moment import STANDSTILL_MPS
from simbev_ros.foundation.types import Float64Array
from simbev_ros.schema.scene.drive_spec import DriveSpec

GOAL = "goal"
"""Reason for the end of a drive that has reached its goal."""

_WINDOW_M = 50.0  # along the route, so that a route may cross itself


class RouteTracker:
    """Follows the ego along its route, tick by tick.

    Attributes:
        distance_m: Distance along the route that the ego has reached; it never falls.
        ended: Why the drive is over: goal, off_route, standstill or timeout; "" while it goes on.
    """

    def __init__(self, drive: DriveSpec, tick_s: float) -> None:
        self._drive, self._tick_s = drive, tick_s
        self._line_m, self._at_m = drive.route.points_m[:, :2], np.array(drive.route.distance_m)
        self.distance_m, self.ended = 0.0, ""
        self._ticks = self._standing_ticks = 0

    @property
    def completed(self) -> float:
        """Share of the route that is completed."""
        return 1.0 if self.ended == GOAL else self.distance_m / self._drive.route.length_m

    def advance(self, position_m: Float64Array, speed_mps: float) -> float:
        """Take the ego's (3,) position and speed at the next tick; returns ``distance_m``."""
        first, last = np.searchsorted(self._at_m, [self.distance_m - _WINDOW_M, self.distance_m + _WINDOW_M])
        part = shapely.LineString(self._line_m[max(first - 1, 0) : last + 1])
        here = shapely.Point(position_m[:2])
        along_m = self._at_m[max(first - 1, 0)] + shapely.line_locate_point(part, here)
        self.distance_m = max(self.distance_m, float(along_m))
        self._ticks += 1
        self._standing_ticks = self._standing_ticks + 1 if speed_mps < STANDSTILL_MPS else 0
        drive = self._drive
        if drive.route.length_m - self.distance_m <= drive.goal_radius_m:
            self.ended = GOAL
        elif shapely.distance(part, here) > drive.off_route_m:
            self.ended = "off_route"
        elif self._standing_ticks * self._tick_s >= drive.standstill_s:
            self.ended = "standstill"
        elif drive.timeout_s is not None and self._ticks * self._tick_s >= drive.timeout_s:
            self.ended = "timeout"
        return self.distance_m
