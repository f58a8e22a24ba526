"""Careful drivers brake for what the body of their vehicle would hit.

SUMO keeps vehicles apart on lanes, but ignores the area that their bodies sweep. This module predicts the trajectories
of all bodies for a few seconds, at SUMO's moment, and limits the speeds of SUMO's vehicles:

- Of two vehicles in conflict, the one that needs less braking yields, so that it stays out of the other's path.
- Drivers who would pass each other too closely move aside.
- Drivers do not brake where this cannot help: for a vehicle that hits them from behind or from the side.
- A driver who has waited for long passes others who stand at a smaller distance, and creeps towards pedestrians who
  stand in the way, so that they step aside, and up to vehicles that do. Drivers who stand in its way back off.
- A driver who yields is predicted as if it drove off, all others as they drive now. It therefore waits until its path
  is clear, and no two drivers wait for each other.
"""

from collections.abc import Callable

import numpy as np

from simbev_ros.foundation.types import BoolArray, Float64Array, Int64Array
from simbev_ros.simulation.world.driving.backing_off import BackingOff
from simbev_ros.simulation.world.driving.conflicts import MARGINS_M, Conflicts, PredictedTraffic
from simbev_ros.simulation.world.driving.trajectory_prediction import (
    TIMES_S,
    PredictedTrajectories,
    TrajectoryPredictor,
    predict_pedestrians,
)
from simbev_ros.simulation.world.kinematics.motion import Bodies
from simbev_ros.simulation.world.kinematics.towing import towed_headings
from simbev_ros.simulation.world.sumo.traffic import SumoTraffic

_REASON = "conflict"
_STOP_GAP_M = 0.4
_MIN_BRAKING_MPS2 = 2.0  # SUMO's own driver handles anything below
_MAX_BRAKING_MPS2 = 8.0
_SLOW_CONTACT_S = 0.6  # time to a contact that SUMO's driver no longer avoids
_LOOK_PERIOD_S = 0.2
_CREEP_MPS = 0.4
_STANDING_MPS = 0.02
_FRONT_DEPTH_M = 0.5
_MIN_ALIGNMENT = 0.8  # cosine of the angle up to which vehicles pass each other and do not cross
_MAX_OFFSET_M, _MAX_LACKING_M = 0.6, 1.2
_OFFSET_STEP_M = 0.1  # correction of the offset at each look
_RETURN_MPS = 0.15


class CarefulDrivers:
    """The careful drivers of a scene: they look for conflicts and brake for them.

    Attributes:
        braking_mps2: Deceleration of each vehicle that yields now.
    """

    def __init__(
        self,
        bodies: Bodies,
        heeds: BoolArray,
        front_m: Float64Array,
        traffic: SumoTraffic,
        tick_s: float,
        patience_s: float = np.inf,
        is_paved: Callable[[Float64Array], BoolArray] | None = None,
    ) -> None:
        """Start at rest.

        Args:
            bodies: Bodies of V vehicles, with what they tow, and P pedestrians.
            heeds: (V, 2) whether each driver brakes for vehicles, and for pedestrians.
            front_m: (M, 3) fronts of the first M vehicles, which are SUMO's; the other vehicles never move.
            traffic: SUMO.
            tick_s: Length of a tick.
            patience_s: Time after which a driver who yields creeps, passes others closely or beside the pavement, and
                lets others back off; infinite on maps where nobody meets where there is no room.
            is_paved: Function from (N, 3) points to (N,) whether vehicles may drive there; None: everywhere.
        """
        self._patience_s, self._is_paved = patience_s, is_paved
        self.braking_mps2: dict[int, float] = {}
        self._vehicles, self._sumo_count = bodies.boxes.vehicles, len(front_m)
        self._half_m = bodies.boxes.size_m[:, :2] / 2.0
        self._half_m[self._vehicles :] = self._half_m[self._vehicles :].max(axis=1, keepdims=True)
        self._heeds = np.zeros((len(self._half_m), 2), bool)
        self._heeds[: self._sumo_count] = heeds[: self._sumo_count]
        self._towing, self._towed, self._lead_m = bodies.towing, bodies.towed, bodies.lead_m
        self._tower = np.full(len(self._half_m), -1)
        self._tower[bodies.towed] = bodies.towing.leader
        self._traffic = traffic
        self._tick_s = tick_s
        self._predictor = TrajectoryPredictor(bodies, front_m, traffic, tick_s)
        self._look_period_ticks = max(1, round(_LOOK_PERIOD_S / tick_s))
        self._passing_offsets = PassingOffsets(self._sumo_count, self._look_period_ticks * tick_s)
        self._backing_off = BackingOff(self._sumo_count, traffic, tick_s, patience_s)
        self._waited_s: dict[int, float] = {}
        self._creeping: frozenset[int] = frozenset()
        self._steps = 0
        self._pedestrian_m: Float64Array | None = None

    @property
    def offset_m(self) -> Float64Array:
        """(M, 3) offset of each vehicle from SUMO's position, map frame."""
        offset_m: Float64Array = np.zeros((self._sumo_count, 3))
        offset_m[:, :2] = self._predictor.offset_m[:, None] * self._predictor.left
        return offset_m

    @property
    def back_m(self) -> Float64Array:
        """(M,) distance of each vehicle's body behind SUMO's vehicle, along its path."""
        return self._backing_off.back_m

    def look_and_brake(
        self,
        front_m: Float64Array,
        point_m: Float64Array,
        rear_m: Float64Array,
        position_m: Float64Array,
        ahead: Float64Array,
        is_reversing: BoolArray,
        has_stopped: BoolArray,
        on_sidewalk: BoolArray,
    ) -> None:
        """Look for conflicts and brake for them. Call it once for each step of the traffic.

        Args:
            front_m: (M, 3) fronts of SUMO's vehicles.
            point_m: (M, 3) their leading points.
            rear_m: (M, 3) their rear axles.
            position_m: (G, 3) current positions of all bodies.
            ahead: (V, 2) unit vectors of the headings of vehicles and of what they tow.
            is_reversing: (M,) whether each of SUMO's vehicles moves backward.
            has_stopped: (G,) whether each body has crashed and never moves again.
            on_sidewalk: (P,) whether each pedestrian is on a sidewalk.
        """
        self._steps += 1
        self._predictor.observe(front_m, point_m, rear_m, is_reversing)
        now = self._predict(position_m[:, :2], ahead, has_stopped, on_sidewalk)
        self.braking_mps2 = {vehicle: mps2 for vehicle, mps2 in self.braking_mps2.items() if not has_stopped[vehicle]}
        looks_now = (np.arange(len(has_stopped)) + self._steps) % self._look_period_ticks == 0
        drivers = np.flatnonzero(self._heeds.any(axis=1) & ~has_stopped & looks_now)
        self._resolve_conflicts(drivers, now, position_m[:, 2], has_stopped)
        self._backing_off.pass_standing(self._predictor.speed_mps, position_m[: self._sumo_count, :2])
        self._backing_off.advance(self._predictor.speed_mps)
        for vehicle, braking_mps2 in self.braking_mps2.items():
            speed_mps = self._traffic.speed_mps(vehicle) - braking_mps2 * self._tick_s
            self._traffic.limit_speed(vehicle, _REASON, max(speed_mps, _CREEP_MPS * (vehicle in self._creeping)))

    def _predict(
        self, position_m: Float64Array, ahead: Float64Array, has_stopped: BoolArray, on_sidewalk: BoolArray
    ) -> PredictedTrajectories:
        """Predicted trajectories of all bodies, now at (G, 2), if nobody changes its behavior."""
        vehicle_m, pedestrian_m = np.split(position_m, [self._vehicles])
        before_m = pedestrian_m if self._pedestrian_m is None else self._pedestrian_m
        self._pedestrian_m = pedestrian_m
        velocity_mps = np.where(has_stopped[self._vehicles :, None], 0.0, (pedestrian_m - before_m) / self._tick_s)
        pedestrians = predict_pedestrians(pedestrian_m, velocity_mps, on_sidewalk)
        center_m, forward = (np.repeat(each[:, None], len(TIMES_S), axis=1) for each in (vehicle_m, ahead))
        driving = np.flatnonzero(~has_stopped[: self._sumo_count] & (self._predictor.speed_mps > _STANDING_MPS))
        prediction = self._predictor.predict(driving, is_released=False)
        center_m[driving], forward[driving] = prediction.center_m, prediction.forward
        self._predict_towed(center_m, forward)
        return PredictedTrajectories(
            np.concatenate([center_m, pedestrians.center_m]), np.concatenate([forward, pedestrians.forward])
        )

    def _predict_towed(self, center_m: Float64Array, forward: Float64Array) -> None:
        """Let the units that vehicles tow follow (V, K, 2) predicted centers and headings, which are completed."""
        towing, towed = self._towing, self._towed
        to_hitch_m = (self._lead_m[towing.leader] - towing.behind_m)[:, None, None]
        hitch_m = center_m[towing.leader] + to_hitch_m * forward[towing.leader]
        for number in range(1, len(TIMES_S)):
            step_m = hitch_m[:, number] - hitch_m[:, number - 1]
            forward[towed, number] = towed_headings(forward[towed, number - 1], step_m, towing.length_m)
        center_m[towed] = hitch_m - self._lead_m[towed, None, None] * forward[towed]

    def _resolve_conflicts(
        self, drivers: Int64Array, now: PredictedTrajectories, height_m: Float64Array, has_stopped: BoolArray
    ) -> None:
        """Decide which of (D,) drivers brake, and how hard, which move aside, and who backs off for them."""
        predicted = PredictedTraffic(self._half_m, height_m, self._predict_released(now), now)
        moving = drivers[~predicted.own.stays[drivers]]
        conflicts = predicted.find_conflicts(moving, self._patient)
        conflicts = conflicts.select(self._tower[conflicts.other] != conflicts.driver)
        is_pedestrian = conflicts.other >= self._vehicles
        conflicts = conflicts.select(self._heeds[conflicts.driver, is_pedestrian.astype(np.intp)])
        needed_mps2, brakes = self._decide_braking(conflicts, predicted)
        self._passing_offsets.update_offsets(moving, conflicts.select(conflicts.other < self._vehicles), predicted)
        self._keep_on_pavement(np.setdiff1d(moving, self._patient))
        self._predictor.target_offset_m = self._passing_offsets.offset_m
        self._brake(drivers, conflicts.driver[brakes], needed_mps2[brakes])
        self._creep(drivers, conflicts.select(brakes), predicted)
        may_back = predicted.as_seen.stays & ~has_stopped & self._heeds[:, 0]
        in_the_way = conflicts.select(brakes & may_back[conflicts.other])
        self._backing_off.make_room(in_the_way, np.isin(in_the_way.driver, self._patient), may_back, predicted)

    def _keep_on_pavement(self, drivers: Int64Array) -> None:
        """Let (D,) drivers move aside only as far as the fronts of their vehicles stay on the pavement."""
        offset_m = self._passing_offsets.offset_m
        aside = drivers[offset_m[drivers] != 0.0]
        if self._is_paved is not None and len(aside):
            side = np.sign(offset_m[aside])
            steps_m = np.arange(0.0, _MAX_OFFSET_M + _OFFSET_STEP_M / 2.0, _OFFSET_STEP_M)
            edge_m = side[:, None] * (self._half_m[aside, 1, None] + steps_m)
            paved = self._is_paved(self._traffic.ahead_m(aside, np.zeros_like(edge_m), edge_m).reshape(-1, 3))
            clear = np.logical_and.accumulate(paved.reshape(edge_m.shape), axis=1).sum(axis=1)
            room_m = np.maximum(clear - 1, 0) * _OFFSET_STEP_M
            offset_m[aside] = side * np.minimum(np.abs(offset_m[aside]), room_m)

    def _predict_released(self, now: PredictedTrajectories) -> PredictedTrajectories:
        """The trajectories of all bodies if those that yield drove off."""
        yielding = np.array(sorted(self.braking_mps2), np.int64)
        if not len(yielding):
            return now
        center_m, forward = now.center_m.copy(), now.forward.copy()
        prediction = self._predictor.predict(yielding, is_released=True)
        center_m[yielding], forward[yielding] = prediction.center_m, prediction.forward
        return PredictedTrajectories(center_m, forward)

    def _decide_braking(self, conflicts: Conflicts, predicted: PredictedTraffic) -> tuple[Float64Array, BoolArray]:
        """(N,) decelerations that the drivers need in conflicts, and (N,) whether they brake in each."""
        needed_mps2, is_useless = self._needed_mps2(conflicts, predicted)
        is_careful = self._heeds[conflicts.other, 0]
        others_mps2, others_useless = np.full(len(is_careful), np.inf), np.ones(len(is_careful), bool)
        others_view = conflicts.select(is_careful).swapped()
        others_mps2[is_careful], others_useless[is_careful] = self._needed_mps2(others_view, predicted)
        others_mps2[others_useless] = np.inf
        is_held = np.isin(conflicts.driver, list(self.braking_mps2))
        needs_less = (needed_mps2 < others_mps2) | ((needed_mps2 == others_mps2) & (conflicts.driver > conflicts.other))
        yields = ~is_useless & (is_held | needs_less | (others_mps2 > _MAX_BRAKING_MPS2))
        yields |= is_useless & others_useless & (is_held | is_careful)
        avoids = needed_mps2 > _MIN_BRAKING_MPS2
        if np.isfinite(self._patience_s):  # vehicles that touch stand in the way for good
            avoids |= TIMES_S[conflicts.first_time] <= _SLOW_CONTACT_S
        return needed_mps2, yields & (is_held | avoids)

    def _needed_mps2(self, conflicts: Conflicts, predicted: PredictedTraffic) -> tuple[Float64Array, BoolArray]:
        """Deceleration that drivers need to avoid the first contact of each conflict.

        Returns:
            (N,) decelerations, and (N,) whether braking is useless because the driver already blocks the other's path.
        """
        if not len(conflicts.driver):
            return np.zeros(0), np.zeros(0, bool)
        first_contacts, entry_time = predicted.first_contacts(conflicts), predicted.entry_time(conflicts)
        gap_m, reach_m = first_contacts.gap_m[:, 0], first_contacts.reach_m[:, 0]
        # A pedestrian who steps in front of a vehicle blocks its path; the vehicle waits nevertheless.
        steps_in_front = (conflicts.other >= self._vehicles) & (
            gap_m > self._half_m[conflicts.driver, 0] - _FRONT_DEPTH_M
        )
        is_useless = (entry_time == 0) & ~steps_in_front
        entry_time = np.where(entry_time == 0, conflicts.first_time, entry_time)
        first_s, step_s, half_s = TIMES_S[conflicts.first_time], TIMES_S[1], TIMES_S[1] / 2.0
        speed_mps = self._predictor.speed_mps[conflicts.driver]
        moved_m = (
            predicted.as_seen.center_m[conflicts.other, conflicts.first_time]
            - predicted.as_seen.center_m[conflicts.other, 0]
        )
        along_mps = np.sum(moved_m * first_contacts.ahead, axis=1) / np.maximum(first_s, half_s)
        closing_mps = speed_mps - np.clip(along_mps, 0.0, speed_mps)
        distance_m = closing_mps * np.maximum(TIMES_S[entry_time] - half_s, half_s) - _STOP_GAP_M
        stopping_mps2 = closing_mps**2 / (2.0 * np.maximum(distance_m, 0.1))
        falling_back_mps2 = 2.0 * np.maximum(reach_m - gap_m, 0.0) / np.maximum(first_s, step_s) ** 2
        return np.maximum(stopping_mps2, falling_back_mps2), is_useless

    def _brake(self, drivers: Int64Array, yielding: Int64Array, needed_mps2: Float64Array) -> None:
        """Brake those of (D,) drivers who yield in (N,) conflicts, as hard as needed, and release the rest."""
        for vehicle in sorted(self.braking_mps2.keys() & set(drivers.tolist()) - set(yielding.tolist())):
            self._traffic.limit_speed(vehicle, _REASON, None)
            del self.braking_mps2[vehicle]
        for vehicle in np.unique(yielding).tolist():
            self.braking_mps2[vehicle] = min(float(needed_mps2[yielding == vehicle].max()), _MAX_BRAKING_MPS2)

    @property
    def _patient(self) -> Int64Array:
        """The drivers who have yielded for long."""
        waited = [vehicle for vehicle in self.braking_mps2 if self._waited_s.get(vehicle, 0.0) > self._patience_s]
        return np.array(sorted(waited), np.int64)

    def _creep(self, drivers: Int64Array, conflicts: Conflicts, predicted: PredictedTraffic) -> None:
        """Let those of (D,) drivers creep who have yielded for long, now first of all to others who stand.

        They stop in front of vehicles.
        """
        for vehicle in drivers.tolist():
            waited_s = self._waited_s.pop(vehicle, 0.0) + _LOOK_PERIOD_S
            if vehicle in self.braking_mps2:
                self._waited_s[vehicle] = waited_s
        lets_creep = (conflicts.other >= self._vehicles) | (TIMES_S[conflicts.first_time] > _SLOW_CONTACT_S)
        lets_creep &= predicted.as_seen.stays[conflicts.other]
        order = np.lexsort([lets_creep, conflicts.first_time])
        first = {int(conflicts.driver[row]): bool(lets_creep[row]) for row in order[::-1]}
        creeping = {vehicle for vehicle in self._patient.tolist() if first.get(vehicle, vehicle in self._creeping)}
        self._creeping = frozenset(creeping)


class PassingOffsets:
    """Lateral offsets of drivers from SUMO's positions.

    Attributes:
        offset_m: (V,) desired offset of each vehicle to the left.
    """

    def __init__(self, vehicles: int, look_period_s: float) -> None:
        """Start without offsets; drivers look every ``look_period_s``."""
        self.offset_m: Float64Array = np.zeros(vehicles)
        self._look_period_s = look_period_s
        self._undisturbed_s = np.zeros(vehicles)  # time since each driver last had to make room

    def update_offsets(self, drivers: Int64Array, conflicts: Conflicts, predicted: PredictedTraffic) -> None:
        """Move those of (D,) drivers aside who meet other vehicles too closely, and let the undisturbed ones return."""
        first_contacts = predicted.first_contacts(conflicts)
        gap_m = first_contacts.gap_m[:, 1]
        lacking_m = first_contacts.reach_m[:, 1] + MARGINS_M[0] - np.abs(gap_m)
        is_passing = predicted.as_seen.stays[conflicts.other] | (first_contacts.alignment > _MIN_ALIGNMENT)
        is_passing &= (lacking_m > 0.0) & (lacking_m < _MAX_LACKING_M)
        self._undisturbed_s[drivers] += self._look_period_s
        self._undisturbed_s[conflicts.driver[is_passing]] = 0.0
        undisturbed = drivers[self._undisturbed_s[drivers] > TIMES_S[-1]]
        return_m = np.minimum(np.abs(self.offset_m[undisturbed]), _RETURN_MPS * self._look_period_s)
        self.offset_m[undisturbed] -= np.sign(self.offset_m[undisturbed]) * return_m
        step_m = np.minimum(lacking_m[is_passing], _OFFSET_STEP_M)
        np.add.at(self.offset_m, conflicts.driver[is_passing], -np.sign(gap_m[is_passing]) * step_m)
        np.clip(self.offset_m, -_MAX_OFFSET_M, _MAX_OFFSET_M, out=self.offset_m)
