"""People off SUMO's net: they leave it to cross a street or to visit a plaza, and come back onto it.

SUMO's people keep to its net. Where somebody is to leave it, the world takes it off and walks it; where its way ends
it goes back onto the net.
"""

from collections import deque
from collections.abc import Iterator, Mapping

import numpy as np

from simbev_ros.scene.spec import NS_PER_S, SceneSpec
from simbev_ros.types import BoolArray, Float64Array, Int64Array
from simbev_ros.world.cast import blueprint_of
from simbev_ros.world.pedestrians.free_walk import Stroller
from simbev_ros.world.pedestrians.itineraries import Leg
from simbev_ros.world.pedestrians.jaywalks import Jaywalks
from simbev_ros.world.pedestrians.plaza_visits import PlazaVisit
from simbev_ros.world.sumo.traffic import Traffic, TrafficSample

_AT_PLACE_M = 0.5
_SIDEWALK_M = 3.0


class Excursions:
    """All ways of people off the net in a scene."""

    def __init__(
        self, spec: SceneSpec, ways: Mapping[int, tuple[Leg, ...]], traffic: Traffic, front_m: Float64Array
    ) -> None:
        """All are on the net but those whose ways begin on plazas.

        Args:
            spec: The scene.
            ways: The legs of those of its pedestrians who leave the net.
            traffic: Where they walk.
            front_m: (V, 3) of its vehicles.
        """
        self._traffic = traffic
        self._tick_s = spec.tick_ns / NS_PER_S
        people = [spec.pedestrians[index] for index in traffic.pedestrians]
        self._speed_mps = [person.max_speed_mps for person in people]
        self._half_length_m = [blueprint_of(person.blueprint).size_m[0] / 2.0 for person in people]
        self._legs = {row: deque(ways[index]) for row, index in enumerate(traffic.pedestrians) if index in ways}
        self._jaywalks = Jaywalks(spec, traffic, front_m)
        self._pedestrian_m: Float64Array = np.zeros((len(people), 3))
        self._strollers: dict[int, tuple[Stroller, Iterator[None]]] = {}
        self._visits: dict[int, PlazaVisit] = {}
        for row, legs in self._legs.items():
            if legs[0].at_halt and isinstance(visit := legs[0].excursion, PlazaVisit):
                self._take_out(row, visit.halt_m)
        self._plan()

    @property
    def jaywalking(self) -> BoolArray:
        """(P,) who is on its way across a street."""
        return self._jaywalks.on_way

    def advance(self, sample: TrafficSample, crashed: BoolArray) -> Float64Array:
        """(P, 3) where people are; to be called once for each step of the traffic.

        Args:
            sample: The traffic now.
            crashed: (P,) who has had a collision and goes nowhere any more.
        """
        self._jaywalks.observe(sample)
        self._pedestrian_m = sample.pedestrian_m
        self._leave(crashed)
        walking = list(self._strollers.items())
        for row, (_, steps) in walking:
            if not crashed[row]:
                next(steps, None)
        self._jaywalks.warn()
        return _placed(sample.pedestrian_m, {row: stroller.position_m for row, (stroller, _) in walking})

    def at_start(self, pedestrian_m: Float64Array, direction: Float64Array) -> tuple[Float64Array, Float64Array]:
        """(P, 3) where people are before the first step, and in which directions they look, if SUMO says these."""
        ways_m = {row: visit.way_back_m for row, visit in self._visits.items()}
        ahead = {row: (way_m[1] - way_m[0]) / np.linalg.norm(way_m[1] - way_m[0]) for row, way_m in ways_m.items()}
        return _placed(pedestrian_m, {row: way_m[0] for row, way_m in ways_m.items()}), _placed(direction, ahead)

    def paving_m(self, pedestrian_m: Float64Array) -> Float64Array:
        """(P,) heights of the plazas that people at (P, 3) places visit; nan: of who visits none."""
        height_m = np.full(len(pedestrian_m), np.nan)
        for row, visit in self._visits.items():
            height_m[row] = visit.ground.linear(pedestrian_m[row : row + 1, :2])[0]
        return height_m

    def _plan(self) -> None:
        """Note down who will leave the net next, and where."""
        nexts = {row: legs[0].excursion for row, legs in self._legs.items() if row not in self._strollers}
        coming = {row: excursion for row, excursion in nexts.items() if excursion is not None}
        self._coming: Int64Array = np.array(list(coming), np.int64)
        self._leave_m = np.array([excursion.start_m[:2] for excursion in coming.values()]).reshape(-1, 2)
        self._along = np.array([excursion.along for excursion in coming.values()]).reshape(-1, 2)

    def _leave(self, crashed: BoolArray) -> None:
        """Take those off the net who have come to where they leave it."""
        gap_m = self._pedestrian_m[self._coming, :2] - self._leave_m
        along_m = np.abs(np.sum(gap_m * self._along, axis=1))
        there = (along_m < _AT_PLACE_M) & (np.linalg.norm(gap_m, axis=1) < _SIDEWALK_M) & ~crashed[self._coming]
        rows = self._coming[there].tolist()
        for row in rows:
            self._take_out(row, self._pedestrian_m[row])
        if rows:
            self._plan()

    def _take_out(self, row: int, place_m: Float64Array) -> None:
        """Let somebody begin its next excursion at a (3,) place."""
        leg = self._legs[row].popleft()
        assert leg.excursion is not None
        stroller = Stroller(place_m, self._speed_mps[row], self._half_length_m[row], self._tick_s)
        if isinstance(leg.excursion, PlazaVisit):
            self._visits[row] = leg.excursion
            steps = _visit(stroller, leg.excursion, leg.at_halt)
        else:
            steps = self._jaywalks.cross(row, stroller, leg.excursion)
        self._strollers[row] = stroller, self._stroll(row, stroller, steps, leg.excursion.far_position_m)
        self._traffic.take_out(row)

    def _stroll(self, row: int, stroller: Stroller, steps: Iterator[None], position_m: float) -> Iterator[None]:
        """All from leaving the net to walking on it again, from SUMO's position on the next leg, tick by tick."""
        yield from steps
        leg = self._legs[row][0]
        self._traffic.put_back(row, leg.edges, position_m, leg.arrival_m)
        yield
        self._traffic.pace(row, 0.0)
        yield from stroller.go(self._pedestrian_m[row])
        self._traffic.pace(row, self._speed_mps[row])
        self._jaywalks.end(row)
        self._visits.pop(row, None)
        del self._strollers[row]
        self._plan()


def _visit(stroller: Stroller, visit: PlazaVisit, at_halt: bool) -> Iterator[None]:
    """A round over a plaza, or what is left of it from the halt on."""
    if not at_halt:
        yield from stroller.follow(visit.way_there_m(stroller.position_m))
    yield from stroller.stand(visit.halt_s)
    yield from stroller.follow(visit.way_back_m)


def _placed(vectors: Float64Array, others: Mapping[int, Float64Array]) -> Float64Array:
    """(P, 3) vectors, other ones in some rows."""
    placed = vectors.copy()
    for row, vector in others.items():
        placed[row] = vector
    return placed
