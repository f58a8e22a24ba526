"""Wrecks over time: actors that have collided are removed from the scene after a while, as if towed away."""

import numpy as np

from simbev_ros.foundation.types import BoolArray, Int64Array
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.simulation.world.kinematics.motion import Bodies
from simbev_ros.simulation.world.population import Population

_NOBODY: Int64Array = np.zeros(0, np.int64)


class Wrecks:
    """The wrecks of a scene. Towed units are removed with their vehicles; vehicles of agents stay.

    Attributes:
        removed: (G,) bool; whether each body is no longer in the scene.
    """

    def __init__(self, spec: SceneSpec, population: Population, bodies: Bodies) -> None:
        """Start without wrecks, in a scene whose first V of G bodies are the population's vehicles."""
        cleared_s = spec.wrecks_cleared_s
        self._ticks = None if cleared_s is None else round(cleared_s * NS_PER_S / spec.tick_ns)
        self._population, self._towed, self._leader = population, bodies.towed, bodies.towing.leader
        self.removed: BoolArray = np.zeros(len(bodies.trail_m), bool)
        self._crashed_ticks = np.zeros(len(self.removed), np.int64)
        carriers = {agent.vehicle for agent in spec.agents}
        stays = np.zeros(len(self.removed), bool)
        stays[: len(population.vehicles)] = [index in carriers for index in population.vehicles]
        stays[self._towed] = stays[self._leader]
        self._may_go = ~stays

    def due(self, crashed: BoolArray) -> Int64Array:
        """(K,) bodies that are removed now, also from SUMO; ``crashed`` (G,) marks all that have collided."""
        if self._ticks is None or not crashed.any():
            return _NOBODY
        self._crashed_ticks += crashed
        due = np.flatnonzero((self._crashed_ticks > self._ticks) & ~self.removed & self._may_go)
        self.clear(due)
        return due

    def clear(self, bodies: Int64Array) -> None:
        """Remove (K,) bodies from SUMO, each once."""
        self.removed[bodies] = True
        for body in bodies.tolist():
            if not self._towed.start <= body < self._towed.stop:
                count = self._towed.stop - self._towed.start
                self._population.clear_crashed(body if body < self._towed.start else body - count)
