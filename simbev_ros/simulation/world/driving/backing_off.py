"""Drivers back off who stand in the way of others who have waited for long, as far as there is room behind them.

SUMO's vehicles never move backward. The body alone does, along the path on which it has come, while SUMO's vehicle
waits; it catches up when this drives on.

At junctions, SUMO's drivers also wait for others who wait for them, and then nobody drives again. Drivers who have
stood for long therefore pass others who have, too, even those with the right of way.
"""

import numpy as np

from simbev_ros.foundation.types import BoolArray, Float64Array
from simbev_ros.simulation.world.driving.conflicts import Conflicts, PredictedTraffic
from simbev_ros.simulation.world.sumo.traffic import SumoTraffic

_REASON = "backing off"
MAX_BACK_M, _STEP_M = 4.0, 0.25  # in all, and at each look
_MPS = 1.25
_CATCH_UP_RATE = 0.15  # meters made up per meter driven
_MAX_QUEUE = 5  # vehicles that move for one who waits
_HOLD_S = 5.0  # time that the others have to pass
_STANDING_MPS = 0.02
_NEAR_M, _PASS_M = 20.0, 15.0  # from those whom a driver passes who has stood for long; distance driven to pass them


class BackingOff:
    """The drivers of a scene who back off.

    Attributes:
        back_m: (V,) distance of each body behind SUMO's vehicle, along its path.
    """

    def __init__(self, vehicles: int, traffic: SumoTraffic, tick_s: float, patience_s: float) -> None:
        """Start where SUMO's V vehicles are; drivers who have stood for ``patience_s`` pass others who stand."""
        self.back_m: Float64Array = np.zeros(vehicles)
        self._traffic = traffic
        self._tick_s = tick_s
        self._target_m = np.zeros(vehicles)
        self._held: dict[int, tuple[int, float]] = {}  # those who back off → the one who waits, and the time left
        self._patience_s = patience_s
        self._stood_s: Float64Array = np.zeros(vehicles)
        self._passed: dict[int, list[int]] = {}  # those who have stood for long → others who have, too
        self._pass_m: Float64Array = np.zeros(vehicles)  # distance for which they pass them

    def pass_standing(self, speed_mps: Float64Array, position_m: Float64Array) -> None:
        """Let drivers who have stood for long pass others near them; vehicles have (V,) speeds, and are at (V, 2)."""
        self._stood_s = np.where(speed_mps > _STANDING_MPS, 0.0, self._stood_s + self._tick_s)
        self._pass_m = self._pass_m - speed_mps * self._tick_s
        stuck = np.flatnonzero(self._stood_s > self._patience_s)
        self._pass_m[stuck] = _PASS_M
        passed = {vehicle: others for vehicle, others in self._passed.items() if self._pass_m[vehicle] > 0.0}
        for vehicle in stuck.tolist():
            is_near = np.hypot(*(position_m[stuck] - position_m[vehicle]).T) < _NEAR_M
            passed[vehicle] = stuck[is_near & (stuck != vehicle)].tolist()
        before, self._passed = self._passed, passed
        for vehicle in sorted(before.keys() | passed.keys()):
            if before.get(vehicle, []) != passed.get(vehicle, []):
                self._traffic.ignore_at_junctions(vehicle, self._obstacles_of(vehicle))

    def advance(self, speed_mps: Float64Array) -> None:
        """Move the bodies by one tick, in which they have (V,) speeds."""
        if not self._held and not self.back_m.any():
            return
        for vehicle, (waiting, left_s) in list(self._held.items()):
            self._held[vehicle] = waiting, left_s - self._tick_s
            if left_s <= 0.0:
                del self._held[vehicle]
                self._traffic.limit_speed(vehicle, _REASON, None)
                self._traffic.ignore_at_junctions(waiting, self._obstacles_of(waiting))
        caught_up_m = _CATCH_UP_RATE * speed_mps * self._tick_s
        caught_up_m[list(self._held)] = 0.0
        self._target_m = np.maximum(self._target_m - caught_up_m, 0.0)
        further_m = np.minimum(self._target_m - self.back_m, _MPS * self._tick_s)
        self.back_m = self.back_m + further_m

    def make_room(
        self, conflicts: Conflicts, has_waited: BoolArray, may_back: BoolArray, predicted: PredictedTraffic
    ) -> None:
        """Let those back off who stand in the way of drivers who have waited for long, until these have passed.

        Nobody backs off for a driver who does so already, so that two do not make room for each other.

        Args:
            conflicts: N conflicts of drivers with others who may back off.
            has_waited: (N,) whether each driver has waited for long.
            may_back: (G,) whether each body is a vehicle that stands and may back off.
            predicted: The traffic of G bodies.
        """
        ahead = predicted.as_seen.forward[conflicts.other, 0]
        contact_m = predicted.own.center_m[conflicts.driver, conflicts.first_time]
        ahead_m = np.sum((contact_m - predicted.as_seen.center_m[conflicts.other, 0]) * ahead, axis=1)
        for row in np.lexsort([conflicts.first_time, conflicts.driver]).tolist():
            driver, other = int(conflicts.driver[row]), int(conflicts.other[row])
            waiting = self._waiting_for(other)
            makes_room = waiting == driver
            if driver in self._held or not (makes_room or (has_waited[row] and waiting is None)):
                continue
            moved = self._step_back(other, may_back, predicted) if ahead_m[row] > 0.0 else None
            if moved is None and makes_room and not predicted.as_seen.stays[driver]:
                moved = other
            if moved is not None:
                for vehicle in {moved, other}:
                    if self._waiting_for(vehicle) in (None, driver):
                        self._held[vehicle] = driver, _HOLD_S
                        self._traffic.limit_speed(vehicle, _REASON, 0.0)
                self._traffic.ignore_at_junctions(driver, self._obstacles_of(driver))

    def _step_back(self, vehicle: int, may_back: BoolArray, predicted: PredictedTraffic) -> int | None:
        """Move a vehicle back a little, or the one close behind it that can; returns which moves, None if none can."""
        for _ in range(_MAX_QUEUE):
            step_m = min(self._target_m[vehicle] + _STEP_M, MAX_BACK_M) - self.back_m[vehicle]
            if step_m <= 0.0:
                return None
            blockers = predicted.in_the_way(vehicle, -step_m * predicted.as_seen.forward[vehicle, 0])
            if not len(blockers):
                self._target_m[vehicle] = self.back_m[vehicle] + step_m
                return vehicle
            if not may_back[blockers].all():
                return None
            vehicle = int(blockers[0])
        return None

    def _waiting_for(self, vehicle: int) -> int | None:
        """The driver for whom a vehicle backs off."""
        return self._held[vehicle][0] if vehicle in self._held else None

    def _obstacles_of(self, waiting: int) -> list[int]:
        """Those who back off for a driver, and those whom it passes."""
        backing = {vehicle for vehicle, (driver, _) in self._held.items() if driver == waiting}
        return sorted(backing.union(self._passed.get(waiting, ())))
