"""Doors of standing vehicles: they open now and then, and close before the vehicle moves.

All decisions are made at SUMO's moment, which is ahead of the published tables. SUMO holds a vehicle from the opening
of its doors until the tables show them closed, so that no vehicle moves with an open door.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from simbev_ros.foundation.random import stream
from simbev_ros.foundation.types import Float64Array, UInt8Array
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.scene.blueprints import blueprint_named
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.simulation.world.sumo.traffic import SumoTraffic

_MIN_STOOD_S = 1.0
_WILL_STAND_S = 3.0
_MAX_CREEP_M = 1e-4  # movement per tick that counts as standing: SUMO's drivers never come to rest entirely
_MIN_OPEN_S, _MAX_OPEN_S = 1.5, 6.0
_REASON = "doors"
_ALL_DOORS_PROBABILITY = 0.5  # probability that all doors open; otherwise one does


@dataclass(slots=True)
class _Opening:
    """One opening of a vehicle's doors; steps of SUMO.

    Attributes:
        opened_step: Step of the opening.
        closing_step: Latest step of the closing.
        release_step: Step at which the vehicle may drive again; None while its doors are open.
    """

    opened_step: int
    closing_step: int
    release_step: int | None = None


class Doors:
    """The doors of a scene's vehicles over time."""

    def __init__(
        self,
        spec: SceneSpec,
        indices: Sequence[int],
        traffic: SumoTraffic,
        front_m: Float64Array,
        delay_ticks: int,
    ) -> None:
        """Start with all doors closed except in hazard areas, and all vehicles at rest.

        Args:
            spec: The scene.
            indices: Index of each of the V vehicles in the specification.
            traffic: SUMO's traffic.
            front_m: (V, 3) fronts of the vehicles.
            delay_ticks: Number of ticks by which the published tables are behind the traffic.
        """
        self._indices = indices
        self._traffic = traffic
        self._seed = spec.seed
        self._tick_s = spec.tick_ns / NS_PER_S
        vehicles = [spec.vehicles[index] for index in indices]
        self._doors = np.array([blueprint_named(vehicle.blueprint).doors for vehicle in vehicles], np.int64)
        self._probability = np.where(self._doors > 0, [vehicle.door_probability for vehicle in vehicles], 0.0)
        self._delay_ticks = delay_ticks
        self._front_m = front_m
        self._stood_ticks = np.zeros(len(vehicles), np.int64)
        self._openings: dict[int, _Opening] = {}
        stands = [vehicle.stands_at for vehicle in vehicles]
        self._open = np.array([0 if stand is None else stand.open_doors for stand in stands], np.uint8)
        self._published = deque([self._open] * (delay_ticks + 1), maxlen=delay_ticks + 1)

    def advance_doors(self, front_m: Float64Array, step: int) -> UInt8Array:
        """(V,) bits of open doors ``delay_ticks`` ago. Call it once for each step of the traffic."""
        moved_m = np.linalg.norm(front_m - self._front_m, axis=1)
        self._stood_ticks = np.where(moved_m < _MAX_CREEP_M, self._stood_ticks + 1, 0)
        self._front_m = front_m
        self._open = self._open.copy()
        for vehicle, opening in list(self._openings.items()):
            self._update_opening(vehicle, opening, step)
        stood_long_enough = self._stood_ticks == max(round(_MIN_STOOD_S / self._tick_s), self._delay_ticks + 1)
        for vehicle in np.flatnonzero(stood_long_enough & (self._probability > 0.0)).tolist():
            self._open_doors(vehicle, step)
        self._published.append(self._open)
        return self._published[0]

    def open_for_good(self, vehicle: int, doors: int) -> None:
        """Open doors of a vehicle that stands for the whole scene, given as bits."""
        self._open = self._open.copy()
        self._open[vehicle] |= doors

    def _open_doors(self, vehicle: int, step: int) -> None:
        rng = stream(self._seed, f"vehicles.{self._indices[vehicle]}.doors", step)
        is_drawn = rng.random() < self._probability[vehicle]
        if is_drawn and vehicle not in self._openings and self._traffic.will_stand(vehicle, _WILL_STAND_S):
            doors = int(self._doors[vehicle])
            bits = (1 << doors) - 1 if rng.random() < _ALL_DOORS_PROBABILITY else 1 << int(rng.integers(doors))
            self._open[vehicle] = bits
            self._openings[vehicle] = _Opening(step, step + round(rng.uniform(_MIN_OPEN_S, _MAX_OPEN_S) / self._tick_s))
            self._traffic.limit_speed(vehicle, _REASON, 0.0)

    def _update_opening(self, vehicle: int, opening: _Opening, step: int) -> None:
        """Close the doors in time or when the vehicle wants to drive; release the vehicle when they are seen closed."""
        if opening.release_step is None:
            must_close = (step - opening.opened_step) * self._tick_s >= _MIN_OPEN_S and self._traffic.wants_to_move(
                vehicle
            )
            if must_close or step >= opening.closing_step:
                self._open[vehicle] = 0
                opening.release_step = step + self._delay_ticks + 1
        elif step >= opening.release_step:
            self._traffic.limit_speed(vehicle, _REASON, None)
            del self._openings[vehicle]
