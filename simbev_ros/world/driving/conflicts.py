"""Encounters: whose bodies would touch in the next seconds, when they do so at first, and how they lie then.

This is the geometry of the look-out, of boxes on courses, in plan and in the map frame. Courses come from
``foresight``; what drivers make of it is up to ``lookout`` and ``passing``.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree

from simbev_ros.types import BoolArray, Float64Array, Int64Array
from simbev_ros.world.driving.trajectory_prediction import TIMES_S, Course

MARGINS_M = (0.25, 0.1, 0.02)  # between bodies; the next one of those who are closer already
_LEVEL_M = 3.0


@dataclass(frozen=True, slots=True)
class Encounters:
    """N drivers and the bodies that they would touch; bodies by their places among all.

    Attributes:
        me: (N,) the drivers.
        other: (N,) whom each would touch.
        margin_m: (N,) the gap between the two that counts as a touch.
        first: (N,) which of ``TIMES_S`` is the first one at which they touch.
    """

    me: Int64Array
    other: Int64Array
    margin_m: Float64Array
    first: Int64Array

    def where(self, chosen: BoolArray) -> "Encounters":
        """Those of the N that are chosen, (N,)."""
        return Encounters(self.me[chosen], self.other[chosen], self.margin_m[chosen], self.first[chosen])

    def reversed(self) -> "Encounters":
        """The same as the others would have them if these were the drivers."""
        return Encounters(self.other, self.me, self.margin_m, self.first)


@dataclass(frozen=True, slots=True)
class Touches:
    """How N drivers and their others lie when they touch at first; pairs are metres ahead and to the driver's left.

    Attributes:
        ahead: (N, 2) unit vectors in which the drivers look, map frame.
        gap_m: (N, 2) from the driver's middle to the other's.
        reach_m: (N, 2) gaps at which the boxes are just beside each other.
        alignment: (N,) cosines of the angles between their axes, 0 to 1.
    """

    ahead: Float64Array
    gap_m: Float64Array
    reach_m: Float64Array
    alignment: Float64Array


@dataclass(frozen=True, slots=True)
class Outlook:
    """The courses of G bodies as drivers weigh them.

    Attributes:
        half_m: (G, 2) half lengths and widths.
        height_m: (G,) of the bodies now.
        own: How each goes if it is the driver that looks.
        others: How each goes in the eyes of the rest.
    """

    half_m: Float64Array
    height_m: Float64Array
    own: Course
    others: Course

    @property
    def radius_m(self) -> Float64Array:
        """(G,) of the circles around the boxes."""
        radius_m: Float64Array = np.hypot(*self.half_m.T)
        return radius_m

    def encounters(self, drivers: Int64Array) -> Encounters:
        """Of (D,) drivers, with all whom they would touch later than now."""
        me, other = self._near(drivers)
        margin_m = self._margins_m(me, other)
        later = np.arange(1, len(TIMES_S))
        first = self._first(Encounters(me, other, margin_m, np.full(len(me), len(TIMES_S))), later, later)
        return Encounters(me, other, margin_m, first).where(first < len(TIMES_S))

    def entry(self, met: Encounters) -> Int64Array:
        """(N,) which of ``TIMES_S`` drivers enter the way that others take after that; the first touch at the latest.

        Of 0 the driver is on that way already.
        """
        return self._first(met, *np.triu_indices(len(TIMES_S), 1))

    def touches(self, met: Encounters) -> Touches:
        """How those who meet lie when they touch at first."""
        ahead, forward = self.own.forward[met.me, met.first], self.others.forward[met.other, met.first]
        left = np.column_stack([-ahead[:, 1], ahead[:, 0]])
        between_m = self.others.center_m[met.other, met.first] - self.own.center_m[met.me, met.first]
        gap_m = np.column_stack([np.sum(between_m * ahead, axis=1), np.sum(between_m * left, axis=1)])
        cos, sin = np.abs(np.sum(ahead * forward, axis=1)), np.abs(np.sum(left * forward, axis=1))
        others_half_m = self.half_m[met.other]
        reach_m = self.half_m[met.me] + cos[:, None] * others_half_m + sin[:, None] * others_half_m[:, ::-1]
        return Touches(ahead, gap_m, reach_m, cos)

    def _near(self, drivers: Int64Array) -> tuple[Int64Array, Int64Array]:
        """(N,) of the drivers, and (N,) bodies whose courses may meet theirs."""
        if not len(drivers):
            return drivers, drivers
        radius_m, middle_m = self.radius_m, self.others.middle_m
        reach_m = self.others.span_m / 2.0 + radius_m
        my_middle_m = self.own.middle_m[drivers]
        my_reach_m = self.own.span_m[drivers] / 2.0 + (radius_m[drivers] + MARGINS_M[0])
        found = cKDTree(middle_m).query_ball_point(my_middle_m, my_reach_m + reach_m.max(), return_sorted=True)
        number = np.repeat(np.arange(len(drivers)), [len(each) for each in found])
        me, other = drivers[number], np.concatenate(found).astype(np.int64)
        gap_m = np.linalg.norm(my_middle_m[number] - middle_m[other], axis=1)
        near = (me != other) & (gap_m < my_reach_m[number] + reach_m[other])
        near &= np.abs(self.height_m[me] - self.height_m[other]) < _LEVEL_M
        return me[near], other[near]

    def _margins_m(self, me: Int64Array, other: Int64Array) -> Float64Array:
        """(N,) how far apart pairs of bodies shall stay."""
        margin_m = np.full(len(me), MARGINS_M[0])
        gap_m = self.others.center_m[other, 0] - self.own.center_m[me, 0]
        close = np.flatnonzero(np.hypot(*gap_m.T) < self.radius_m[me] + self.radius_m[other] + MARGINS_M[0])
        me, other = me[close], other[close]
        ahead, others_ahead = self.own.forward[me, 0], self.others.forward[other, 0]
        for wide_m, narrow_m in pairwise(MARGINS_M):
            within = _overlap(gap_m[close], ahead, others_ahead, self.half_m[me] + wide_m, self.half_m[other])
            margin_m[close[within]] = narrow_m
        return margin_m

    def _first(self, met: Encounters, my_time: Int64Array, their_time: Int64Array) -> Int64Array:
        """(N,) first of the (T,) times of drivers at which they touch others, who are where they are at (T,) others.

        It is ``met.first`` for those who touch nobody until then.
        """
        pair, number = np.nonzero(my_time <= met.first[:, None])
        time = my_time[number]
        touch = self._touching(met.me[pair], time, met.other[pair], their_time[number], met.margin_m[pair])
        first = met.first.copy()
        np.minimum.at(first, pair[touch], time[touch])
        return first

    def _touching(
        self, me: Int64Array, my_time: Int64Array, other: Int64Array, their_time: Int64Array, margin_m: Float64Array
    ) -> Int64Array:
        """(M,) which of (N,) drivers and others touch, each at (N,) times of its own."""
        gap_m = self.others.center_m[other, their_time] - self.own.center_m[me, my_time]
        reach_m = self.radius_m[me] + self.radius_m[other] + margin_m
        close = np.flatnonzero(np.sum(gap_m**2, axis=1) < reach_m**2)
        me, other = me[close], other[close]
        overlaps = _overlap(
            gap_m[close],
            self.own.forward[me, my_time[close]],
            self.others.forward[other, their_time[close]],
            self.half_m[me] + margin_m[close, None],
            self.half_m[other],
        )
        touching: Int64Array = close[overlaps]
        return touching


def _overlap(
    gap_m: Float64Array,
    ahead: Float64Array,
    others_ahead: Float64Array,
    half_m: Float64Array,
    others_half_m: Float64Array,
) -> BoolArray:
    """(N,) whether boxes overlap in plan: middles (N, 2) apart, looking (N, 2) ahead, (N, 2) half sizes."""
    cos = np.abs(np.sum(ahead * others_ahead, axis=1))
    sin = np.abs(ahead[:, 0] * others_ahead[:, 1] - ahead[:, 1] * others_ahead[:, 0])
    overlaps = np.ones(len(gap_m), bool)
    for axis, own, other in ((ahead, half_m, others_half_m), (others_ahead, others_half_m, half_m)):
        along_m = np.abs(np.sum(gap_m * axis, axis=1))
        aside_m = np.abs(gap_m[:, 0] * axis[:, 1] - gap_m[:, 1] * axis[:, 0])
        overlaps &= along_m < own[:, 0] + cos * other[:, 0] + sin * other[:, 1]
        overlaps &= aside_m < own[:, 1] + sin * other[:, 0] + cos * other[:, 1]
    return overlaps
