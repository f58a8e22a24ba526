"""The vehicles that stand in a hazard area: those that crashed, who came to help, and those of road works."""

import math

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.random import stream
from simbev_ros.scene.blueprints import Blueprint, blueprint_index, load_blueprints
from simbev_ros.scene.footprints import footprints
from simbev_ros.scene.hazards.area import HazardArea
from simbev_ros.scene.hazards.guards import BARRIER_M
from simbev_ros.scene.spec import StandSpec, VehicleSpec, WaypointSpec
from simbev_ros.semantics import Tag

_CRASHES_DEG = ((0.0, 9.0), (12.0, 40.0), (55.0, 90.0))  # between two cars: one ran into the other's end, or its side
_WORKS = (("vehicle.tipper",), ("vehicle.van",), ("vehicle.tipper", "vehicle.van"))
_NARROW_WORKS = ("vehicle.van", "vehicle.city_van")  # instead of what the area is too narrow for
_THIRD_CAR, _OPEN_DOOR = 0.4, 0.5  # probabilities; of the third car where there is room
_HELP_GAP_M, _CRASH_GAP_M, _WORK_GAP_M = (1.5, 4.0), (0.1, 0.5), (0.5, 4.0)
_FROM_END_M = 0.5
_CLEAR_M = 0.05  # between vehicles and the border of the area or what guards it
_STEP_M = 0.1
_STRAIGHTER, _TRIES = 0.7, 12


def accident_vehicles(
    area: HazardArea, guards: BaseGeometry, helped: bool, seed: int, name: str
) -> tuple[VehicleSpec, ...]:
    """Two or three cars as they came to rest, clear of what guards them.

    If they are ``helped``, the first one is an emergency vehicle.
    """
    rng = stream(seed, f"{name}.vehicles")
    row = _Row(area, guards, area.body_m[0] + _FROM_END_M, area.body_m[1] - _FROM_END_M)
    if helped:
        row.add(_one_of([each for each in load_blueprints() if each.emergency and row.holds(each)], rng), 0.0, 0.0, rng)
    cars = [each for each in load_blueprints() if each.tag == Tag.CAR and not each.emergency and row.holds(each)]
    crash_rad = np.radians(_CRASHES_DEG[int(rng.integers(len(_CRASHES_DEG)))])
    for number in range(3 if rng.random() < _THIRD_CAR else 2):
        gap_m = rng.uniform(*(_CRASH_GAP_M if number else _HELP_GAP_M)) if row.vehicles else 0.0
        turn_rad = rng.choice([-1.0, 1.0]) * rng.uniform(*(crash_rad if number else np.radians(_CRASHES_DEG[0])))
        row.add(_one_of(cars, rng), gap_m, turn_rad, rng, crashed=True)
    return tuple(row.vehicles)


def works_vehicles(area: HazardArea, guards: BaseGeometry, seed: int, name: str) -> tuple[VehicleSpec, ...]:
    """A tipper, a van, or both, as far as they fit, clear of what guards them."""
    rng = stream(seed, f"{name}.vehicles")
    row = _Row(area, guards, area.body_m[0] + BARRIER_M + _FROM_END_M, area.body_m[1] - BARRIER_M - _FROM_END_M)
    for wanted in _WORKS[int(rng.integers(len(_WORKS)))]:
        possible = [load_blueprints()[blueprint_index()[each]] for each in (wanted, *_NARROW_WORKS)]
        blueprint = next((each for each in possible if row.holds(each)), possible[-1])
        row.add(blueprint, rng.uniform(*_WORK_GAP_M), 0.0, rng)
    return tuple(row.vehicles)


class _Row:
    """Vehicles one behind the other in the body of an area, from ``begin_m`` to ``end_m`` behind its tip."""

    def __init__(self, area: HazardArea, guards: BaseGeometry, begin_m: float, end_m: float) -> None:
        self._area = area
        self._inside = shapely.Polygon(area.outline_m).buffer(-_CLEAR_M).difference(guards.buffer(_CLEAR_M))
        shapely.prepare(self._inside)
        self._begin_m, self._end_m = begin_m, end_m
        self._last: BaseGeometry = shapely.Polygon()
        self.vehicles: list[VehicleSpec] = []

    def holds(self, blueprint: Blueprint) -> bool:
        """Whether the area is wide enough."""
        return blueprint.size_m[1] + 2.0 * _CLEAR_M <= self._area.free_m

    def add(
        self, blueprint: Blueprint, gap_m: float, turn_rad: float, rng: np.random.Generator, crashed: bool = False
    ) -> None:
        """Let a vehicle stand a gap behind the last one, turned as far as there is room; without room, leave it out."""
        for turn in (turn_rad * _STRAIGHTER ** np.arange(_TRIES)).tolist():
            half_m = (blueprint.size_m[0] * abs(math.cos(turn)) + blueprint.size_m[1] * abs(math.sin(turn))) / 2.0
            along_m = np.arange(self._begin_m + half_m, self._end_m - half_m, _STEP_M)
            position_m, yaw_rad = self._area.places(along_m, np.full(len(along_m), self._area.free_m / 2.0))
            boxes = footprints(np.array(blueprint.size_m), position_m, yaw_rad + turn)
            apart = self._last.is_empty | (shapely.distance(boxes, self._last) >= gap_m)
            room = np.flatnonzero(apart & shapely.covers(self._inside, boxes))
            if len(room):
                place = int(room[0])
                self._begin_m, self._last = float(along_m[place]), boxes[place]
                x_m, y_m, z_m = position_m[place].tolist()
                stand = StandSpec(
                    x_m=x_m,
                    y_m=y_m,
                    z_m=z_m,
                    yaw_rad=float(yaw_rad[place]) + turn,
                    hazard_lights=not blueprint.emergency,
                    open_doors=self._doors(blueprint, rng) if crashed else 0,
                )
                self.vehicles.append(self._vehicle(blueprint, stand, self._area.from_s_m + float(along_m[place]), rng))
                return

    def _doors(self, blueprint: Blueprint, rng: np.random.Generator) -> int:
        """Bits of open doors: at random some of those away from the traffic, all of them even-numbered or odd."""
        away = [door for door in range(blueprint.doors) if door % 2 == (self._area.side > 0)]
        opened = rng.random(len(away)) < _OPEN_DOOR
        return sum(1 << door for door, is_open in zip(away, opened.tolist(), strict=True) if is_open)

    def _vehicle(self, blueprint: Blueprint, stand: StandSpec, s_m: float, rng: np.random.Generator) -> VehicleSpec:
        return VehicleSpec(
            blueprint=blueprint.name,
            color=blueprint.colors[int(rng.integers(len(blueprint.colors)))],
            start=WaypointSpec(lane=self._area.closed[0].id, s_m=s_m),
            speed_factor=1.0,
            min_gap_m=0.0,
            emergency_lights=blueprint.emergency,
            stands_at=stand,
        )


def _one_of(blueprints: list[Blueprint], rng: np.random.Generator) -> Blueprint:
    """One of them, each as often as it is frequent."""
    upto = np.cumsum([blueprint.frequency for blueprint in blueprints])
    return blueprints[int(np.searchsorted(upto, rng.random() * upto[-1], side="right"))]
