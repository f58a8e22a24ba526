"""Pauses: pedestrians stand on a sidewalk for a while, as people do who wait for someone or look at a shop window."""

from collections.abc import Container, Iterator

import numpy as np

from simbev_ros.foundation.random import stream
from simbev_ros.foundation.types import BoolArray
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.simulation.world.population import Population
from simbev_ros.simulation.world.sumo.names import pedestrian_name

_DURATION_S = 5.0, 25.0


def draw_pauses(spec: SceneSpec, index: int) -> Iterator[tuple[float, float]]:
    """Yield start and end of each pause of a pedestrian, in seconds since the start of the scene, ascending.

    On average the pauses take ``spec.pedestrian_standing_share`` of the time, from the start of the scene on.

    Args:
        spec: The scene.
        index: Index of the pedestrian in the specification.
    """
    share, rng = spec.pedestrian_standing_share, stream(spec.seed, f"{pedestrian_name(index)}.pauses")
    if share == 0.0:
        return
    start_s, duration_s = 0.0, rng.uniform(*_DURATION_S) * rng.random()  # this one began before the scene
    if rng.random() < share:
        yield start_s, duration_s
    else:
        duration_s = 0.0
    while True:
        start_s += duration_s + rng.exponential(np.mean(_DURATION_S) * (1.0 - share) / share)
        duration_s = rng.uniform(*_DURATION_S)
        yield start_s, start_s + duration_s


class Pauses:
    """All pauses in a scene. A pause that is due elsewhere, as on a crosswalk, begins on the next sidewalk."""

    def __init__(self, spec: SceneSpec, population: Population) -> None:
        """Start before the first step."""
        self._walkers = population.sumo.walkers
        self._tick_s = spec.tick_ns / NS_PER_S
        self._speed_mps = [spec.pedestrians[index].max_speed_mps for index in population.pedestrians]
        self._coming = [draw_pauses(spec, spec.leader_of(index)) for index in population.pedestrians]
        self._pause_s = np.array([next(pauses, (np.inf, np.inf)) for pauses in self._coming]).reshape(-1, 2)
        self._standing: set[int] = set()

    def advance_pauses(self, step: int, away: Container[int], crashed: BoolArray) -> None:
        """Let pedestrians stop and walk on. Call it once per step.

        Args:
            step: Number of steps since the start of the scene.
            away: Pedestrians on excursions, which do not pause.
            crashed: (P,) whether each pedestrian has collided and never moves again.
        """
        now_s = step * self._tick_s
        for row in np.flatnonzero((self._pause_s[:, 0] <= now_s) & ~crashed).tolist():
            if row in away:
                self._standing.discard(row)
            elif row not in self._standing and self._walkers.is_on_sidewalk(row):
                self._standing.add(row)
                self._walkers.limit_speed(row, 0.0)
            if self._pause_s[row, 1] <= now_s:
                self._pause_s[row] = next(self._coming[row])
                if row in self._standing:
                    self._standing.remove(row)
                    self._walkers.limit_speed(row, self._speed_mps[row])
