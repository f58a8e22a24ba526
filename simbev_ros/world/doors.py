"""Doors of vehicles that stand: opened now and then, and shut before the vehicle moves.

All is decided at SUMO's moment, which is ahead of the tables. A vehicle is stopped in SUMO from the opening until its
doors are seen to be shut, so that none moves with an open door.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from simbev_ros.random import stream
from simbev_ros.scene.spec import NS_PER_S, SceneSpec
from simbev_ros.types import Float64Array, UInt8Array
from simbev_ros.world.cast import blueprint_of

_STOOD_S = 1.0
_WILL_STAND_S = 3.0
_CREEPING_M = 1e-4  # a tick: SUMO's drivers never come to rest entirely
_SHORTEST_S, _LONGEST_S = 1.5, 6.0
_REASON = "doors"
_ALL = 0.5  # how often all doors open; else one does


class StandingTraffic(Protocol):
    """What doors ask of the traffic; vehicles by their place in ``vehicles``."""

    @property
    def vehicles(self) -> Sequence[int]:
        """Indices in the specification."""

    def stands_on(self, vehicle: int, for_s: float) -> bool:
        """Whether a vehicle at rest has a reason to stay there for so long."""

    def wants_to_move(self, vehicle: int) -> bool:
        """Whether a stopped vehicle would drive."""

    def limit(self, vehicle: int, reason: str, speed_mps: float | None) -> None:
        """Let a vehicle drive no faster for a reason; None: lift that."""


@dataclass(slots=True)
class _Visit:
    """One opening: until when at most, in steps; and once shut, when the vehicle may go."""

    opened: int
    shuts: int
    goes: int | None = None


class Doors:
    """Doors of a scene's vehicles over time."""

    def __init__(self, spec: SceneSpec, traffic: StandingTraffic, front_m: Float64Array, delay_ticks: int) -> None:
        """All shut but those of hazard areas, at rest at the (V, 3) places ``front_m``.

        What is seen is ``delay_ticks`` behind the traffic.
        """
        self._traffic = traffic
        self._seed = spec.seed
        self._tick_s = spec.tick_ns / NS_PER_S
        vehicles = [spec.vehicles[index] for index in traffic.vehicles]
        self._doors = np.array([blueprint_of(vehicle.blueprint).doors for vehicle in vehicles], np.int64)
        self._probability = np.where(self._doors > 0, [vehicle.door_probability for vehicle in vehicles], 0.0)
        self._delay_ticks = delay_ticks
        self._front_m = front_m
        self._stood_ticks = np.zeros(len(vehicles), np.int64)
        self._visits: dict[int, _Visit] = {}
        stands = [vehicle.stands_at for vehicle in vehicles]
        self._open = np.array([0 if stand is None else stand.open_doors for stand in stands], np.uint8)
        self._seen = deque([self._open] * (delay_ticks + 1), maxlen=delay_ticks + 1)

    def advance(self, front_m: Float64Array, step: int) -> UInt8Array:
        """(V,) bits of open doors ``delay_ticks`` ago; to be called once for each step of the traffic."""
        moved_m = np.linalg.norm(front_m - self._front_m, axis=1)
        self._stood_ticks = np.where(moved_m < _CREEPING_M, self._stood_ticks + 1, 0)
        self._front_m = front_m
        self._open = self._open.copy()
        for vehicle, visit in list(self._visits.items()):
            self._end(vehicle, visit, step)
        enough = self._stood_ticks == max(round(_STOOD_S / self._tick_s), self._delay_ticks + 1)
        for vehicle in np.flatnonzero(enough & (self._probability > 0.0)).tolist():
            self._begin(vehicle, step)
        self._seen.append(self._open)
        return self._seen[0]

    def _begin(self, vehicle: int, step: int) -> None:
        rng = stream(self._seed, f"vehicles.{self._traffic.vehicles[vehicle]}.doors", step)
        wanted = rng.random() < self._probability[vehicle]
        if wanted and vehicle not in self._visits and self._traffic.stands_on(vehicle, _WILL_STAND_S):
            doors = int(self._doors[vehicle])
            bits = (1 << doors) - 1 if rng.random() < _ALL else 1 << int(rng.integers(doors))
            self._open[vehicle] = bits
            self._visits[vehicle] = _Visit(step, step + round(rng.uniform(_SHORTEST_S, _LONGEST_S) / self._tick_s))
            self._traffic.limit(vehicle, _REASON, 0.0)

    def _end(self, vehicle: int, visit: _Visit, step: int) -> None:
        """Shut the doors in time or when the vehicle would go; let it go when that is seen."""
        if visit.goes is None:
            hurries = (step - visit.opened) * self._tick_s >= _SHORTEST_S and self._traffic.wants_to_move(vehicle)
            if hurries or step >= visit.shuts:
                self._open[vehicle] = 0
                visit.goes = step + self._delay_ticks + 1
        elif step >= visit.goes:
            self._traffic.limit(vehicle, _REASON, None)
            del self._visits[vehicle]
