"""Excursions: pedestrians leave SUMO's network to cross a street or to visit a plaza, and return to it.

SUMO's pedestrians stay on its network. At the start of an excursion, this module removes the pedestrian from SUMO and
moves it itself; at the end of the path, it inserts the pedestrian into SUMO again.
"""

from collections import deque
from collections.abc import Iterator, Mapping

import numpy as np

from simbev_ros.foundation.types import BoolArray, Float64Array, Int64Array
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.scene.blueprints import blueprint_named
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.simulation.world.pedestrians.free_walk import FreeWalker
from simbev_ros.simulation.world.pedestrians.itineraries import Leg
from simbev_ros.simulation.world.pedestrians.jaywalks import Jaywalks
from simbev_ros.simulation.world.pedestrians.pauses import Pauses
from simbev_ros.simulation.world.pedestrians.plaza_visits import PlazaVisit
from simbev_ros.simulation.world.population import Population
from simbev_ros.simulation.world.sumo.traffic import TrafficSample

_START_TOLERANCE_M = 0.5
_MAX_LATERAL_M = 3.0


class Excursions:
    """All excursions of pedestrians in a scene.

    Attributes:
        heedless: (P,) whether each pedestrian does not look out for vehicles.
    """

    def __init__(
        self,
        spec: SceneSpec,
        legs_by_index: Mapping[int, tuple[Leg, ...]],
        population: Population,
        front_m: Float64Array,
    ) -> None:
        """Start with all pedestrians on the network, except those whose scene starts on a plaza.

        Args:
            spec: The scene.
            legs_by_index: Legs of the pedestrians that leave the network, by index in the specification.
            population: Vehicles and pedestrians.
            front_m: (V, 3) fronts of the vehicles.
        """
        self._on_net = population.sumo.walkers
        self._tick_s = spec.tick_ns / NS_PER_S
        pedestrians = [spec.pedestrians[index] for index in population.pedestrians]
        self._speed_mps = [pedestrian.max_speed_mps for pedestrian in pedestrians]
        self._half_length_m = [blueprint_named(pedestrian.blueprint).size_m[0] / 2.0 for pedestrian in pedestrians]
        self._legs = {
            row: deque(legs_by_index[index])
            for row, index in enumerate(population.pedestrians)
            if index in legs_by_index
        }
        self._jaywalks = Jaywalks(spec, population, front_m)
        self._pedestrian_m: Float64Array = np.zeros((len(pedestrians), 3))
        self._walkers: dict[int, tuple[FreeWalker, Iterator[None]]] = {}
        self.heedless: BoolArray = np.zeros(len(pedestrians), bool)
        self._visits: dict[int, PlazaVisit] = {}
        for row, legs in self._legs.items():
            if legs[0].starts_at_stop and isinstance(visit := legs[0].excursion, PlazaVisit):
                self._start_excursion(row, visit.stop_position_m)
        self._plan_departures()
        self._pauses, self._steps = Pauses(spec, population), 0
        self._pauses.advance_pauses(0, self._walkers, np.zeros(len(pedestrians), bool))

    def hold(self, row: int, position_m: Float64Array) -> None:
        """Let a pedestrian stand at a (3,) position, off the network, until it is told to ``walk_across``."""
        walker = FreeWalker(position_m, self._speed_mps[row], self._half_length_m[row], self._tick_s)
        self._walkers[row] = walker, iter(())
        self._on_net.remove(row)

    def walk_across(self, row: int, goal_m: Float64Array) -> None:
        """Let a held pedestrian walk straight to a (2,) position, heedless of vehicles, and stay there."""
        walker, _ = self._walkers[row]
        self._walkers[row] = walker, walker.walk_to(np.append(goal_m, walker.position_m[2]))
        self.heedless[row] = self._jaywalks.is_crossing[row] = True

    @property
    def jaywalking(self) -> BoolArray:
        """(P,) whether each pedestrian is crossing a street."""
        return self._jaywalks.is_crossing

    def advance_walkers(self, sample: TrafficSample, crashed: BoolArray) -> Float64Array:
        """(P, 3) positions of the pedestrians. Call it once for each step of the traffic.

        Args:
            sample: The traffic now.
            crashed: (P,) whether each pedestrian has collided and never moves again.
        """
        self._jaywalks.observe(sample)
        self._pedestrian_m = sample.pedestrian_m
        self._leave_network(crashed)
        self._steps += 1
        self._pauses.advance_pauses(self._steps, self._walkers, crashed)
        walkers = list(self._walkers.items())
        for row, (_, steps) in walkers:
            if not crashed[row]:
                next(steps, None)
        self._jaywalks.brake_drivers()
        return _replace_rows(sample.pedestrian_m, {row: walker.position_m for row, (walker, _) in walkers})

    def start_poses(self, pedestrian_m: Float64Array, direction: Float64Array) -> tuple[Float64Array, Float64Array]:
        """(P, 3) positions and (P, 3) headings before the first step, from those that SUMO gives."""
        paths_m = {row: visit.path_from_stop_m for row, visit in self._visits.items()}
        ahead = {
            row: (path_m[1] - path_m[0]) / np.linalg.norm(path_m[1] - path_m[0]) for row, path_m in paths_m.items()
        }
        return _replace_rows(pedestrian_m, {row: path_m[0] for row, path_m in paths_m.items()}), _replace_rows(
            direction, ahead
        )

    def paving_m(self, pedestrian_m: Float64Array) -> Float64Array:
        """(P,) heights of the plazas that pedestrians at (P, 3) positions visit; nan for those who visit none."""
        height_m = np.full(len(pedestrian_m), np.nan)
        for row, visit in self._visits.items():
            height_m[row] = visit.ground.linear(pedestrian_m[row : row + 1, :2])[0]
        return height_m

    def _plan_departures(self) -> None:
        """Store which pedestrians leave the network next, and where."""
        next_excursions = {row: legs[0].excursion for row, legs in self._legs.items() if row not in self._walkers}
        upcoming = {row: excursion for row, excursion in next_excursions.items() if excursion is not None}
        self._upcoming: Int64Array = np.array(list(upcoming), np.int64)
        self._leaving_position_m = np.array([excursion.start_m[:2] for excursion in upcoming.values()]).reshape(-1, 2)
        self._along = np.array([excursion.along for excursion in upcoming.values()]).reshape(-1, 2)

    def _leave_network(self, crashed: BoolArray) -> None:
        """Remove the pedestrians that have arrived where they leave the network."""
        gap_m = self._pedestrian_m[self._upcoming, :2] - self._leaving_position_m
        along_m = np.abs(np.sum(gap_m * self._along, axis=1))
        has_arrived = (
            (along_m < _START_TOLERANCE_M) & (np.linalg.norm(gap_m, axis=1) < _MAX_LATERAL_M) & ~crashed[self._upcoming]
        )
        rows = self._upcoming[has_arrived].tolist()
        for row in rows:
            self._start_excursion(row, self._pedestrian_m[row])
        if rows:
            self._plan_departures()

    def _start_excursion(self, row: int, position_m: Float64Array) -> None:
        """Start a pedestrian's next excursion at a (3,) position."""
        leg = self._legs[row].popleft()
        assert leg.excursion is not None
        walker = FreeWalker(position_m, self._speed_mps[row], self._half_length_m[row], self._tick_s)
        if isinstance(leg.excursion, PlazaVisit):
            self._visits[row] = leg.excursion
            steps = _visit(walker, leg.excursion, leg.starts_at_stop)
        else:
            steps = self._jaywalks.cross(row, walker, leg.excursion)
        self._walkers[row] = walker, self._walk_excursion(row, walker, steps, leg.excursion.end_position_m)
        self._on_net.remove(row)

    def _walk_excursion(self, row: int, walker: FreeWalker, steps: Iterator[None], position_m: float) -> Iterator[None]:
        """All steps from leaving the network to walking on it again, at SUMO's position on the next leg."""
        yield from steps
        leg = self._legs[row][0]
        self._on_net.reinsert(row, leg.edges, position_m, leg.arrival_m, leg.passes)
        yield
        self._on_net.limit_speed(row, 0.0)
        yield from walker.walk_to(self._pedestrian_m[row])
        self._on_net.limit_speed(row, self._speed_mps[row])
        self._jaywalks.end_crossing(row)
        self._visits.pop(row, None)
        del self._walkers[row]
        self._plan_departures()


def _visit(walker: FreeWalker, visit: PlazaVisit, starts_at_stop: bool) -> Iterator[None]:
    """Steps of a visit to a plaza or, if it starts at the stop, of the rest of it."""
    if not starts_at_stop:
        yield from walker.walk_along(visit.path_to_stop_m(walker.position_m))
    yield from walker.wait(visit.stop_duration_s)
    yield from walker.walk_along(visit.path_from_stop_m)


def _replace_rows(vectors: Float64Array, others: Mapping[int, Float64Array]) -> Float64Array:
    """(P, 3) vectors with other ones in some rows."""
    replaced = vectors.copy()
    for row, vector in others.items():
        replaced[row] = vector
    return replaced
