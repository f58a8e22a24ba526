"""Careful drivers look out: they brake for what their vehicle's body would hit, as drivers do who see it coming.

SUMO keeps vehicles apart on lanes, but knows nothing of what bodies sweep. Here the courses of all bodies are foreseen
for a few seconds, at SUMO's moment. Of two vehicles that would touch, the one that needs less braking for it yields, so
that it stays out of the other's way; drivers who pass each other narrowly move aside. Nobody brakes where that does not
help: for who drives into it from behind or from the side. A driver who yields is foreseen to drive off, the others as
they drive, so that it waits until its way is free, and no two wait for each other.
"""

from typing import Protocol

import numpy as np

from simbev_ros.types import BoolArray, Float64Array, Int64Array
from simbev_ros.world.driving.conflicts import Encounters, Outlook
from simbev_ros.world.driving.passing import Passing
from simbev_ros.world.driving.trajectory_prediction import TIMES_S, Course, Foresight, Ways, walks
from simbev_ros.world.kinematics.motion import Bodies

_REASON = "lookout"
_STOP_GAP_M = 0.4
_UNCOMFORTABLE_MPS2 = 2.0  # who needs less leaves it to SUMO's driver
_HARDEST_MPS2 = 8.0
_LOOK_S = 0.2
_STANDING_MPS = 0.02
_FRONT_M = 0.5


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
        self._vehicles, self._sumos = bodies.boxes.vehicles, len(front_m)
        self._half_m = bodies.boxes.size_m[:, :2] / 2.0
        self._half_m[self._vehicles :] = self._half_m[self._vehicles :].max(axis=1, keepdims=True)
        self._careful = np.zeros(len(self._half_m), bool)
        self._careful[: self._sumos] = careful[: self._sumos]
        self._traffic = traffic
        self._tick_s = tick_s
        self._foresight = Foresight(bodies, front_m, traffic, tick_s)
        self._every = max(1, round(_LOOK_S / tick_s))
        self._passing = Passing(self._sumos, self._every * tick_s)
        self._steps = 0
        self._people_m: Float64Array | None = None

    @property
    def aside_m(self) -> Float64Array:
        """(M, 3) by how much vehicles drive beside SUMO's places, map frame."""
        aside_m: Float64Array = np.zeros((self._sumos, 3))
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
        now = self._courses(position_m[:, :2], ahead, still, on_kerb)
        self.braking_mps2 = {vehicle: mps2 for vehicle, mps2 in self.braking_mps2.items() if not still[vehicle]}
        has_its_turn = (np.arange(len(still)) + self._steps) % self._every == 0
        self._look(np.flatnonzero(self._careful & ~still & has_its_turn), now, position_m[:, 2])
        for vehicle, braking_mps2 in self.braking_mps2.items():
            speed_mps = self._traffic.speed_mps(vehicle) - braking_mps2 * self._tick_s
            self._traffic.limit(vehicle, _REASON, max(speed_mps, 0.0))

    def _courses(self, position_m: Float64Array, ahead: Float64Array, still: BoolArray, on_kerb: BoolArray) -> Course:
        """How all bodies at (G, 2) go on now."""
        place_m, people_m = np.split(position_m, [self._vehicles])
        before_m = people_m if self._people_m is None else self._people_m
        self._people_m = people_m
        velocity_mps = np.where(still[self._vehicles :, None], 0.0, (people_m - before_m) / self._tick_s)
        strolls = walks(people_m, velocity_mps, on_kerb)
        center_m, forward = (np.repeat(each[:, None], len(TIMES_S), axis=1) for each in (place_m, ahead))
        drives = np.flatnonzero(~still[: self._sumos] & (self._foresight.speed_mps > _STANDING_MPS))
        course = self._foresight.course(drives, starts=False)
        center_m[drives], forward[drives] = course.center_m, course.forward
        return Course(np.concatenate([center_m, strolls.center_m]), np.concatenate([forward, strolls.forward]))

    def _look(self, drivers: Int64Array, now: Course, height_m: Float64Array) -> None:
        """Decide who of (D,) drivers brakes, and how hard, and who makes room."""
        outlook = Outlook(self._half_m, height_m, self._let_go(now), now)
        moving = drivers[~outlook.own.stays[drivers]]
        met = outlook.encounters(moving)
        needed_mps2, brakes = self._yielding(met, outlook)
        self._passing.advance(moving, met.where(met.other < self._vehicles), outlook)
        self._foresight.aside_m = self._passing.aside_m
        self._brake(drivers, met.me[brakes], needed_mps2[brakes])

    def _let_go(self, now: Course) -> Course:
        """The courses of all bodies if those who yield drove off."""
        held = np.array(sorted(self.braking_mps2), np.int64)
        if not len(held):
            return now
        center_m, forward = now.center_m.copy(), now.forward.copy()
        course = self._foresight.course(held, starts=True)
        center_m[held], forward[held] = course.center_m, course.forward
        return Course(center_m, forward)

    def _yielding(self, met: Encounters, outlook: Outlook) -> tuple[Float64Array, BoolArray]:
        """(N,) decelerations that drivers need in encounters, and (N,) in which of these they brake."""
        needed_mps2, in_vain = self._needed_mps2(met, outlook)
        could = self._careful[met.other]
        others_mps2, others_in_vain = np.full(len(could), np.inf), np.ones(len(could), bool)
        theirs = met.where(could).reversed()
        others_mps2[could], others_in_vain[could] = self._needed_mps2(theirs, outlook)
        others_mps2[others_in_vain] = np.inf
        is_held = np.isin(met.me, list(self.braking_mps2))
        less = (needed_mps2 < others_mps2) | ((needed_mps2 == others_mps2) & (met.me > met.other))
        yields = ~in_vain & (is_held | less | (others_mps2 > _HARDEST_MPS2))
        yields |= in_vain & others_in_vain & (is_held | could)
        return needed_mps2, yields & (is_held | (needed_mps2 > _UNCOMFORTABLE_MPS2))

    def _needed_mps2(self, met: Encounters, outlook: Outlook) -> tuple[Float64Array, BoolArray]:
        """How hard drivers must brake for others whom they would touch.

        Returns:
            (N,) decelerations, and (N,) who is in the other's way already, so that braking does not help.
        """
        touches, entry = outlook.touches(met), outlook.entry(met)
        gap_m, reach_m = touches.gap_m[:, 0], touches.reach_m[:, 0]
        # People who get before a vehicle do so on their own feet; it waits for them all the same.
        walks_ahead = (met.other >= self._vehicles) & (gap_m > self._half_m[met.me, 0] - _FRONT_M)
        in_vain = (entry == 0) & ~walks_ahead
        entry = np.where(entry == 0, met.first, entry)
        first_s, step_s, half_s = TIMES_S[met.first], TIMES_S[1], TIMES_S[1] / 2.0
        speed_mps = self._foresight.speed_mps[met.me]
        gone_m = outlook.others.center_m[met.other, met.first] - outlook.others.center_m[met.other, 0]
        along_mps = np.sum(gone_m * touches.ahead, axis=1) / np.maximum(first_s, half_s)
        closing_mps = speed_mps - np.clip(along_mps, 0.0, speed_mps)
        way_m = closing_mps * np.maximum(TIMES_S[entry] - half_s, half_s) - _STOP_GAP_M
        stopping_mps2 = closing_mps**2 / (2.0 * np.maximum(way_m, 0.1))
        falling_back_mps2 = 2.0 * np.maximum(reach_m - gap_m, 0.0) / np.maximum(first_s, step_s) ** 2
        return np.maximum(stopping_mps2, falling_back_mps2), in_vain

    def _brake(self, drivers: Int64Array, yielding: Int64Array, needed_mps2: Float64Array) -> None:
        """Let those of (D,) drivers brake who yield in (N,) encounters, as hard as needed, and the rest drive on."""
        for vehicle in sorted(self.braking_mps2.keys() & set(drivers.tolist()) - set(yielding.tolist())):
            self._traffic.limit(vehicle, _REASON, None)
            del self.braking_mps2[vehicle]
        for vehicle in np.unique(yielding).tolist():
            self.braking_mps2[vehicle] = min(float(needed_mps2[yielding == vehicle].max()), _HARDEST_MPS2)
