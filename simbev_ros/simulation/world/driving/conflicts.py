"""Conflicts: which bodies would touch in the next seconds, when they first touch, and how they lie then.

This is the geometry behind ``careful_drivers`` and ``passing``: rectangles on predicted trajectories, in plan, in the
map frame. Trajectories come from ``trajectory_prediction``; what drivers do about a conflict is decided elsewhere.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from simbev_ros.foundation.geometry.plan_view import left_of
from simbev_ros.foundation.types import BoolArray, Float64Array, Int64Array
from simbev_ros.simulation.world.driving.trajectory_prediction import TIMES_S, PredictedTrajectories

MARGINS_M = (0.25, 0.1, 0.02)  # minimum gap between bodies; a pair that is already closer uses the next smaller one
_LEVEL_TOLERANCE_M = 3.0
_NOBODY: Int64Array = np.empty(0, np.int64)


@dataclass(frozen=True, slots=True)
class Conflicts:
    """N pairs of a driver and a body that it would touch; bodies are given by their index.

    Attributes:
        driver: (N,) the drivers.
        other: (N,) the body that each would touch.
        margin_m: (N,) gap between the two that counts as contact.
        first_time: (N,) index into ``TIMES_S`` of the first contact.
    """

    driver: Int64Array
    other: Int64Array
    margin_m: Float64Array
    first_time: Int64Array

    def select(self, chosen: BoolArray) -> "Conflicts":
        """The conflicts selected by an (N,) mask."""
        return Conflicts(self.driver[chosen], self.other[chosen], self.margin_m[chosen], self.first_time[chosen])

    def swapped(self) -> "Conflicts":
        """The same conflicts with the roles of driver and other exchanged."""
        return Conflicts(self.other, self.driver, self.margin_m, self.first_time)


@dataclass(frozen=True, slots=True)
class FirstContacts:
    """Geometry of N first contacts; pairs of values are meters ahead and meters to the driver's left.

    Attributes:
        ahead: (N, 2) unit vectors of the drivers' headings, map frame.
        gap_m: (N, 2) from the driver's center to the other's.
        reach_m: (N, 2) gaps at which the boxes just touch side by side.
        alignment: (N,) cosine of the angle between their axes, 0 to 1.
    """

    ahead: Float64Array
    gap_m: Float64Array
    reach_m: Float64Array
    alignment: Float64Array


@dataclass(frozen=True)
class PredictedTraffic:
    """Predicted trajectories of G bodies, from the viewpoint of the drivers.

    Attributes:
        half_m: (G, 2) half lengths and widths.
        height_m: (G,) current heights of the bodies.
        own: Trajectory of each body when it is the driver that looks.
        as_seen: Trajectory of each body as all other drivers expect it.
    """

    half_m: Float64Array
    height_m: Float64Array
    own: PredictedTrajectories
    as_seen: PredictedTrajectories

    @cached_property
    def radius_m(self) -> Float64Array:
        """(G,) radii of the circles around the boxes."""
        return np.hypot(*self.half_m.T)

    def find_conflicts(self, drivers: Int64Array, patient: Int64Array = _NOBODY) -> Conflicts:
        """Conflicts of (D,) drivers with all bodies that they would touch later than now.

        The ``patient`` ones of them have waited for long: they pass bodies that stand with the smallest margin.
        """
        driver, other = self._candidate_pairs(drivers)
        margin_m = self._margins_m(driver, other)
        margin_m[np.isin(driver, patient) & self.as_seen.stays[other]] = MARGINS_M[-1]
        later = np.arange(1, len(TIMES_S))
        first_time = self._first_contact_time(
            Conflicts(driver, other, margin_m, np.full(len(driver), len(TIMES_S))), later, later
        )
        return Conflicts(driver, other, margin_m, first_time).select(first_time < len(TIMES_S))

    def entry_time(self, conflicts: Conflicts) -> Int64Array:
        """(N,) index into ``TIMES_S`` at which drivers enter the other's later path; at the latest, the first contact.

        Index 0 means that the driver already occupies that path.
        """
        return self._first_contact_time(conflicts, *np.triu_indices(len(TIMES_S), 1))

    def first_contacts(self, conflicts: Conflicts) -> FirstContacts:
        """Geometry of the conflicts at their first contact."""
        ahead, forward = (
            self.own.forward[conflicts.driver, conflicts.first_time],
            self.as_seen.forward[conflicts.other, conflicts.first_time],
        )
        left = left_of(ahead)
        between_m = (
            self.as_seen.center_m[conflicts.other, conflicts.first_time]
            - self.own.center_m[conflicts.driver, conflicts.first_time]
        )
        gap_m = np.column_stack([np.sum(between_m * ahead, axis=1), np.sum(between_m * left, axis=1)])
        cos, sin = np.abs(np.sum(ahead * forward, axis=1)), np.abs(np.sum(left * forward, axis=1))
        other_half_m = self.half_m[conflicts.other]
        reach_m = self.half_m[conflicts.driver] + cos[:, None] * other_half_m + sin[:, None] * other_half_m[:, ::-1]
        return FirstContacts(ahead, gap_m, reach_m, cos)

    def in_the_way(self, body: int, step_m: Float64Array) -> Int64Array:
        """(M,) bodies that come closer than the gap when a body moves by (2,) meters now, and are not so close yet."""
        others = np.delete(np.arange(len(self.half_m)), body)
        others = others[np.abs(self.height_m[others] - self.height_m[body]) < _LEVEL_TOLERANCE_M]
        gap_m = self.as_seen.center_m[others, 0] - self.as_seen.center_m[body, 0]
        boxes = (
            np.broadcast_to(self.as_seen.forward[body, 0], gap_m.shape),
            self.as_seen.forward[others, 0],
            np.broadcast_to(self.half_m[body] + MARGINS_M[0], gap_m.shape),
            self.half_m[others],
        )
        return others[_overlap(gap_m - step_m, *boxes) & ~_overlap(gap_m, *boxes)]

    def _candidate_pairs(self, drivers: Int64Array) -> tuple[Int64Array, Int64Array]:
        """(N,) drivers and (N,) bodies whose trajectories come close."""
        reach_m = self.as_seen.span_m / 2.0 + self.radius_m
        driver_reach_m = self.own.span_m[drivers] / 2.0 + (self.radius_m[drivers] + MARGINS_M[0])
        x_m, y_m = self.own.middle_m[drivers].T[..., None] - self.as_seen.middle_m.T[:, None]
        number, other = np.nonzero(np.sqrt(x_m * x_m + y_m * y_m) < driver_reach_m[:, None] + reach_m)
        driver = drivers[number]
        near = (driver != other) & (np.abs(self.height_m[driver] - self.height_m[other]) < _LEVEL_TOLERANCE_M)
        return driver[near], other[near]

    def _margins_m(self, driver: Int64Array, other: Int64Array) -> Float64Array:
        """(N,) gap that each pair of bodies shall keep."""
        margin_m = np.full(len(driver), MARGINS_M[0])
        gap_m = self.as_seen.center_m[other, 0] - self.own.center_m[driver, 0]
        close = np.flatnonzero(np.hypot(*gap_m.T) < self.radius_m[driver] + self.radius_m[other] + MARGINS_M[0])
        driver, other = driver[close], other[close]
        ahead, other_ahead = self.own.forward[driver, 0], self.as_seen.forward[other, 0]
        for margin_wide_m, margin_narrow_m in pairwise(MARGINS_M):
            within = _overlap(gap_m[close], ahead, other_ahead, self.half_m[driver] + margin_wide_m, self.half_m[other])
            margin_m[close[within]] = margin_narrow_m
        return margin_m

    def _first_contact_time(self, conflicts: Conflicts, driver_time: Int64Array, other_time: Int64Array) -> Int64Array:
        """(N,) first of (T,) driver times at which driver and other touch; the other is at its own (T,) times.

        It is ``conflicts.first_time`` where they do not touch before that.
        """
        pair, number = np.nonzero(driver_time <= conflicts.first_time[:, None])
        time = driver_time[number]
        touch = self._touching_pairs(
            conflicts.driver[pair], time, conflicts.other[pair], other_time[number], conflicts.margin_m[pair]
        )
        first_time = conflicts.first_time.copy()
        np.minimum.at(first_time, pair[touch], time[touch])
        return first_time

    def _touching_pairs(
        self,
        driver: Int64Array,
        driver_time: Int64Array,
        other: Int64Array,
        other_time: Int64Array,
        margin_m: Float64Array,
    ) -> Int64Array:
        """(M,) which of (N,) drivers and others touch, each at (N,) times of its own."""
        gap_m = self.as_seen.center_m[other, other_time] - self.own.center_m[driver, driver_time]
        reach_m = self.radius_m[driver] + self.radius_m[other] + margin_m
        close = np.flatnonzero(np.sum(gap_m**2, axis=1) < reach_m**2)
        driver, other = driver[close], other[close]
        overlaps = _overlap(
            gap_m[close],
            self.own.forward[driver, driver_time[close]],
            self.as_seen.forward[other, other_time[close]],
            self.half_m[driver] + margin_m[close, None],
            self.half_m[other],
        )
        return close[overlaps]


def _overlap(
    gap_m: Float64Array,
    ahead: Float64Array,
    other_ahead: Float64Array,
    half_m: Float64Array,
    other_half_m: Float64Array,
) -> BoolArray:
    """(N,) whether boxes overlap in plan: centers (N, 2) apart, headings (N, 2), half sizes (N, 2)."""
    cos = np.abs(np.sum(ahead * other_ahead, axis=1))
    sin = np.abs(ahead[:, 0] * other_ahead[:, 1] - ahead[:, 1] * other_ahead[:, 0])
    overlaps = np.ones(len(gap_m), bool)
    for axis, own, other in ((ahead, half_m, other_half_m), (other_ahead, other_half_m, half_m)):
        along_m = np.abs(np.sum(gap_m * axis, axis=1))
        aside_m = np.abs(gap_m[:, 0] * axis[:, 1] - gap_m[:, 1] * axis[:, 0])
        overlaps &= along_m < own[:, 0] + cos * other[:, 0] + sin * other[:, 1]
        overlaps &= aside_m < own[:, 1] + sin * other[:, 0] + cos * other[:, 1]
    return overlaps
