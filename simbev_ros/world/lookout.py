"""Careful drivers look out: they brake for what their vehicle's body would hit, as drivers do who see it coming.

SUMO keeps vehicles apart on lanes, but knows nothing of what bodies sweep. Here the courses of all bodies are foreseen
for a few seconds, at SUMO's moment. Of two vehicles that would touch, the one that needs less braking for it yields, so
that it stays out of the other's way; drivers who pass each other narrowly move aside. Nobody brakes where that does not
help: for who drives into it from behind or from the side. A driver who yields is foreseen to drive off, the others as
they drive, so that it waits until its way is free, and no two wait for each other.
"""

from itertools import pairwise
from typing import Protocol

import numpy as np
from scipy.spatial import cKDTree

from simbev_ros.types import BoolArray, Float64Array, Int64Array
from simbev_ros.world.foresight import TIMES_S, Course, Foresight, Ways, walks
from simbev_ros.world.motion import Bodies

_REASON = "lookout"
_MARGINS_M = (0.25, 0.1, 0.02)  # between bodies; the next one of those who are closer already
_STOP_GAP_M = 0.4
_UNCOMFORTABLE_MPS2 = 2.0  # who needs less leaves it to SUMO's driver
_HARDEST_MPS2 = 8.0
_LEVEL_M = 3.0
_LOOK_S = 0.2
_LEAST_WAY_M = 0.05
_STANDING_MPS = 0.02
_FRONT_M = 0.5
_PARALLEL = 0.8  # cosine of the angle at which vehicles still pass each other, and do not cross
_MOST_ASIDE_M, _MOST_LACKING_M = 0.6, 1.2
_STEP_M = 0.1  # by which a driver corrects how far aside it drives at each look
_RETURN_MPS = 0.15


class Drivers(Ways, Protocol):
    """What the look-out asks of the traffic; vehicles by their place in ``vehicles``."""

    def speed_mps(self, vehicle: int) -> float:
        """A vehicle's speed."""

    def limit(self, vehicle: int, reason: str, speed_mps: float | None) -> None:
        """Let a vehicle drive no faster for a reason; None: lift that."""


class Lookout:
    """What all careful drivers of a scene see, and how they brake.

    Attributes:
        braking_mps2: How hard vehicles brake that yield now.
    """

    def __init__(
        self, bodies: Bodies, careful: BoolArray, front_m: Float64Array, traffic: Drivers, tick_s: float
    ) -> None:
        """At rest.

        Args:
            bodies: V vehicles' and P people's.
            careful: (V,) whose drivers look out.
            front_m: (M, 3) fronts of the first vehicles, which are SUMO's; the others stand for ever.
            traffic: SUMO.
            tick_s: Length of a tick.
        """
        self.braking_mps2: dict[int, float] = {}
        self._careful = careful[: len(front_m)]
        self._half_m = bodies.boxes.size_m[:, :2] / 2.0
        self._half_m[bodies.boxes.vehicles :] = self._half_m[bodies.boxes.vehicles :].max(axis=1, keepdims=True)
        self._vehicles = bodies.boxes.vehicles
        self._traffic = traffic
        self._tick_s = tick_s
        self._foresight = Foresight(bodies, front_m, traffic, tick_s)
        self._every = max(1, round(_LOOK_S / tick_s))
        self._quiet_s = np.zeros(len(front_m))  # since drivers had to make room
        self._steps = 0
        self._people_m: Float64Array | None = None

    @property
    def aside_m(self) -> Float64Array:
        """(M, 3) by how much vehicles drive beside SUMO's places, map frame."""
        aside_m: Float64Array = np.zeros((len(self._careful), 3))
        aside_m[:, :2] = self._foresight.is_aside_m[:, None] * self._foresight.left
        return aside_m

    def advance(
        self,
        front_m: Float64Array,
        point_m: Float64Array,
        rear_m: Float64Array,
        position_m: Float64Array,
        ahead: Float64Array,
        still: BoolArray,
        on_kerb: BoolArray,
    ) -> None:
        """Look and brake; to be called once for each step of the traffic.

        Args:
            front_m: (M, 3) fronts of the vehicles that are SUMO's.
            point_m: (M, 3) their points.
            rear_m: (M, 3) their rear axles.
            position_m: (G, 3) of all bodies now.
            ahead: (V, 2) unit vectors in which vehicles look.
            still: (G,) who does, for good.
            on_kerb: (P,) who walks on a sidewalk.
        """
        self._steps += 1
        self._foresight.advance(front_m, point_m, rear_m)
        people_m = position_m[self._vehicles :, :2]
        velocity_mps = np.zeros_like(people_m) if self._people_m is None else (people_m - self._people_m) / self._tick_s
        self._people_m = people_m
        people_ahead = np.broadcast_to([1.0, 0.0], people_m.shape)
        center_m, forward = (
            np.repeat(each[:, None], len(TIMES_S), axis=1)
            for each in (position_m[:, :2], np.concatenate([ahead, people_ahead]))
        )
        sumos = np.arange(len(front_m))
        drives = np.flatnonzero(~still[: len(front_m)] & (self._foresight.speed_mps > _STANDING_MPS))
        walking = self._vehicles + np.flatnonzero(~still[self._vehicles :])
        strolls = walks(people_m, velocity_mps, on_kerb)
        center_m[walking] = strolls.center_m[walking - self._vehicles]
        course = self._foresight.course(drives, starts=False)
        center_m[drives], forward[drives] = course.center_m, course.forward
        for wreck in [vehicle for vehicle in self.braking_mps2 if still[vehicle]]:
            del self.braking_mps2[wreck]
        looks = self._careful & ~still[: len(front_m)] & ((sumos + self._steps) % self._every == 0)
        self._look(np.flatnonzero(looks), Course(center_m, forward), position_m[:, 2])
        for vehicle, braking_mps2 in self.braking_mps2.items():
            speed_mps = self._traffic.speed_mps(vehicle) - braking_mps2 * self._tick_s
            self._traffic.limit(vehicle, _REASON, max(speed_mps, 0.0))

    def _look(self, drivers: Int64Array, now: Course, height_m: Float64Array) -> None:
        """Decide who of (N,) drivers brakes, and how hard."""
        held = np.array(sorted(self.braking_mps2), np.int64)
        freed = Course(now.center_m.copy(), now.forward.copy())
        if len(held):
            course = self._foresight.course(held, True)
            freed.center_m[held], freed.forward[held] = course.center_m, course.forward
        is_held = np.zeros(self._vehicles, bool)
        is_held[held] = True
        way_m = np.linalg.norm(freed.center_m[drivers, -1] - freed.center_m[drivers, 0], axis=1)
        drivers, idle = drivers[way_m > _LEAST_WAY_M], drivers[way_m <= _LEAST_WAY_M]
        me, other = self._near(drivers, freed, now, height_m)
        margin_m = self._margins_m(me, freed, other, now)
        first = self._first(me, freed, other, now, margin_m)
        seen = np.flatnonzero(first < len(TIMES_S))
        me, other, first, margin_m = me[seen], other[seen], first[seen], margin_m[seen]
        needed_mps2, in_vain = self._needed_mps2(me, freed, other, now, first, margin_m)
        others_mps2 = np.full(len(me), np.inf)
        could = np.flatnonzero(other < len(self._careful))
        could = could[self._careful[other[could]]]
        theirs_mps2, theirs_in_vain = self._needed_mps2(
            other[could], freed, me[could], now, first[could], margin_m[could]
        )
        others_mps2[could] = np.where(theirs_in_vain, np.inf, theirs_mps2)
        both_in_vain = in_vain.copy()
        both_in_vain[could] &= theirs_in_vain
        less = (needed_mps2 < others_mps2) | ((needed_mps2 == others_mps2) & (me > other))
        yields = ~in_vain & (is_held[me] | less | (others_mps2 > _HARDEST_MPS2))
        yields |= both_in_vain & (is_held[me] | np.isin(np.arange(len(me)), could))
        brakes = yields & (is_held[me] | (needed_mps2 > _UNCOMFORTABLE_MPS2))
        self._swerve(drivers, me, other, freed, now, first)
        hardest_mps2 = np.zeros(self._vehicles)
        np.maximum.at(hardest_mps2, me[brakes], np.minimum(needed_mps2[brakes], _HARDEST_MPS2))
        for vehicle in sorted(
            {*drivers.tolist(), *idle.tolist()} & self.braking_mps2.keys() - set(me[brakes].tolist())
        ):
            self._traffic.limit(vehicle, _REASON, None)
            del self.braking_mps2[vehicle]
        for vehicle in np.unique(me[brakes]).tolist():
            self.braking_mps2[vehicle] = float(hardest_mps2[vehicle])

    def _swerve(
        self,
        drivers: Int64Array,
        me: Int64Array,
        other: Int64Array,
        mine: Course,
        theirs: Course,
        first: Int64Array,
    ) -> None:
        """Let (N,) drivers make room for others beside their ways, and the rest of those who look drive back."""
        ahead, forward = mine.forward[me, first], theirs.forward[other, first]
        left = np.column_stack([-ahead[:, 1], ahead[:, 0]])
        cos, sin = np.abs(np.sum(ahead * forward, axis=1)), np.abs(np.sum(left * forward, axis=1))
        gap_m = np.sum((theirs.center_m[other, first] - mine.center_m[me, first]) * left, axis=1)
        reach_m = self._half_m[me, 1] + cos * self._half_m[other, 1] + sin * self._half_m[other, 0] + _MARGINS_M[0]
        lacks_m = reach_m - np.abs(gap_m)
        stands = np.linalg.norm(theirs.center_m[other, -1] - theirs.center_m[other, 0], axis=1) < _LEAST_WAY_M
        passes = (lacks_m > 0.0) & (lacks_m < _MOST_LACKING_M) & (stands | (cos > _PARALLEL))
        passes &= other < self._vehicles
        aside_m, look_s = self._foresight.aside_m, self._every * self._tick_s
        self._quiet_s[drivers] += look_s
        self._quiet_s[me[passes]] = 0.0
        back_m = np.sign(aside_m) * np.minimum(np.abs(aside_m), _RETURN_MPS * look_s)
        quiet = drivers[self._quiet_s[drivers] > TIMES_S[-1]]
        aside_m[quiet] -= back_m[quiet]
        np.add.at(aside_m, me[passes], -np.sign(gap_m[passes]) * np.minimum(lacks_m[passes], _STEP_M))
        np.clip(aside_m, -_MOST_ASIDE_M, _MOST_ASIDE_M, out=aside_m)

    def _near(
        self, drivers: Int64Array, mine: Course, theirs: Course, height_m: Float64Array
    ) -> tuple[Int64Array, Int64Array]:
        """(N,) drivers and (N,) bodies whose courses may meet."""
        middle_m = (theirs.center_m[:, 0] + theirs.center_m[:, -1]) / 2.0
        half_m = np.hypot(*self._half_m.T)
        reach_m = np.linalg.norm(theirs.center_m[:, -1] - theirs.center_m[:, 0], axis=1) / 2.0 + half_m
        my_middle_m = (mine.center_m[drivers, 0] + mine.center_m[drivers, -1]) / 2.0
        my_reach_m = np.linalg.norm(mine.center_m[drivers, -1] - mine.center_m[drivers, 0], axis=1) / 2.0
        my_reach_m += half_m[drivers] + _MARGINS_M[0]
        if not len(drivers):
            return drivers, drivers
        found = cKDTree(middle_m).query_ball_point(my_middle_m, my_reach_m + reach_m.max(), return_sorted=True)
        number = np.repeat(np.arange(len(drivers)), [len(each) for each in found])
        other = np.concatenate(found).astype(np.int64)
        me = drivers[number]
        gap_m = np.linalg.norm(my_middle_m[number] - middle_m[other], axis=1)
        near = (gap_m < my_reach_m[number] + reach_m[other]) & (np.abs(height_m[me] - height_m[other]) < _LEVEL_M)
        near &= me != other
        return me[near], other[near]

    def _margins_m(self, me: Int64Array, mine: Course, other: Int64Array, theirs: Course) -> Float64Array:
        """(N,) how far apart pairs of bodies shall stay."""
        margin_m = np.full(len(me), _MARGINS_M[0])
        gap_m = theirs.center_m[other, 0] - mine.center_m[me, 0]
        reach_m = np.hypot(*self._half_m.T)
        close = np.flatnonzero(np.hypot(*gap_m.T) < reach_m[me] + reach_m[other] + _MARGINS_M[0])
        me, other = me[close], other[close]
        for wide_m, narrow_m in pairwise(_MARGINS_M):
            half_m, others_half_m = self._half_m[me] + wide_m, self._half_m[other]
            within = _overlap(gap_m[close], mine.forward[me, 0], theirs.forward[other, 0], half_m, others_half_m)
            margin_m[close[within]] = narrow_m
        return margin_m

    def _first(
        self, me: Int64Array, mine: Course, other: Int64Array, theirs: Course, margin_m: Float64Array
    ) -> Int64Array:
        """(N,) which of ``TIMES_S`` pairs of bodies touch at first; their number if they do not."""
        times = len(TIMES_S)
        gap_m = theirs.center_m[other, 1:] - mine.center_m[me, 1:]
        reach_m = np.hypot(*self._half_m.T)
        close_m = reach_m[me] + reach_m[other] + _MARGINS_M[0]
        pair, number = np.nonzero(np.einsum("nki,nki->nk", gap_m, gap_m) < close_m[:, None] ** 2)
        number += 1
        touch = self._touch(me[pair], mine, number, other[pair], theirs, number, margin_m[pair])
        first = np.full(len(me), times)
        np.minimum.at(first, pair[touch], number[touch])
        return first

    def _touch(
        self,
        me: Int64Array,
        mine: Course,
        my_time: Int64Array,
        other: Int64Array,
        theirs: Course,
        their_time: Int64Array,
        margin_m: Float64Array,
    ) -> Int64Array:
        """(M,) which of (N,) pairs of bodies come closer to each other than (N,) margins, at (N,) times of theirs."""
        gap_m = theirs.center_m[other, their_time] - mine.center_m[me, my_time]
        reach_m = np.hypot(*self._half_m.T)
        close = np.flatnonzero(np.sum(gap_m**2, axis=1) < (reach_m[me] + reach_m[other] + margin_m) ** 2)
        me, other = me[close], other[close]
        overlaps = _overlap(
            gap_m[close],
            mine.forward[me, my_time[close]],
            theirs.forward[other, their_time[close]],
            self._half_m[me] + margin_m[close, None],
            self._half_m[other],
        )
        touch: Int64Array = close[overlaps]
        return touch

    def _needed_mps2(
        self,
        me: Int64Array,
        mine: Course,
        other: Int64Array,
        theirs: Course,
        first: Int64Array,
        margin_m: Float64Array,
    ) -> tuple[Float64Array, BoolArray]:
        """How hard drivers must brake for others whom they would touch at first at (N,) times.

        Returns:
            (N,) decelerations, and (N,) who is in the other's way already, so that braking does not help.
        """
        ahead, half_s = mine.forward[me, first], TIMES_S[1] / 2.0
        gap_m = np.sum((theirs.center_m[other, first] - mine.center_m[me, first]) * ahead, axis=1)
        entry = self._entry(me, mine, other, theirs, first, margin_m)
        # People who get before a vehicle do so on their own feet; it waits for them all the same.
        walks_ahead = (other >= self._vehicles) & (gap_m > self._half_m[me, 0] - _FRONT_M)
        in_vain = (entry == 0) & ~walks_ahead
        entry = np.where(entry == 0, first, entry)
        speed_mps = self._foresight.speed_mps[me]
        gone_m = theirs.center_m[other, first] - theirs.center_m[other, 0]
        along_mps = np.clip(np.sum(gone_m * ahead, axis=1) / np.maximum(TIMES_S[first], half_s), 0.0, speed_mps)
        closing_mps = speed_mps - along_mps
        way_m = closing_mps * np.maximum(TIMES_S[entry] - half_s, half_s) - _STOP_GAP_M
        stopping_mps2 = closing_mps**2 / (2.0 * np.maximum(way_m, 0.1))
        forward, half_m = theirs.forward[other, first], self._half_m[other]
        cos, sin = np.sum(forward * ahead, axis=1), forward[:, 0] * ahead[:, 1] - forward[:, 1] * ahead[:, 0]
        reach_m = self._half_m[me, 0] + np.abs(cos) * half_m[:, 0] + np.abs(sin) * half_m[:, 1]
        falling_back_mps2 = 2.0 * np.maximum(reach_m - gap_m, 0.0) / np.maximum(TIMES_S[first], TIMES_S[1]) ** 2
        return np.maximum(stopping_mps2, falling_back_mps2), in_vain

    def _entry(
        self,
        me: Int64Array,
        mine: Course,
        other: Int64Array,
        theirs: Course,
        first: Int64Array,
        margin_m: Float64Array,
    ) -> Int64Array:
        """(N,) which of ``TIMES_S`` drivers enter the way that others will have taken then, ``first`` at the latest."""
        my_time, their_time = np.triu_indices(len(TIMES_S), 1)
        pair, number = np.nonzero(my_time <= first[:, None])
        touch = self._touch(me[pair], mine, my_time[number], other[pair], theirs, their_time[number], margin_m[pair])
        entry = first.copy()
        np.minimum.at(entry, pair[touch], my_time[number[touch]])
        return entry


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
