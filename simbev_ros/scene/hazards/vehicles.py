"""Vehicles that stand in a hazard area: crashed cars and an emergency vehicle, or the vehicles of road works."""

import math

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.foundation.random import stream
from simbev_ros.foundation.semantics import Tag
from simbev_ros.scene.blueprints import Blueprint, blueprint_named, load_blueprints
from simbev_ros.scene.footprints import footprints
from simbev_ros.scene.hazards.area import HazardArea
from simbev_ros.scene.hazards.guards import BARRIER_ROW_M
from simbev_ros.schema.scene.spec import StandSpec, VehicleSpec, WaypointSpec

_CRASHES_DEG = ((0.0, 9.0), (12.0, 40.0), (55.0, 90.0))  # between two cars: rear-end or side collision
_WORK_VEHICLES = (
    ("vehicle.tipper",),
    ("vehicle.van",),
    ("vehicle.tipper", "vehicle.van"),
    ("vehicle.flatbed_van",),
    ("vehicle.wheel_loader", "vehicle.flatbed_van"),
    ("vehicle.mobile_excavator", "vehicle.tipper"),
)
_NARROW_WORK_VEHICLES = ("vehicle.van", "vehicle.city_van")  # fallbacks where the area is too narrow
_THIRD_CAR, _OPEN_DOOR = 0.4, 0.5  # probabilities; the third car needs room
_HELP_GAP_M, _CRASH_GAP_M, _WORK_GAP_M = (1.5, 4.0), (0.1, 0.5), (0.5, 4.0)
_END_MARGIN_M = 0.5
_CLEARANCE_M = 0.05  # between vehicles and the area's border or its guards
_STEP_M = 0.1
_TURN_REDUCTION, _TRIES = 0.7, 12


def place_accident_vehicles(
    area: HazardArea, guards: BaseGeometry, has_help: bool, seed: int, name: str
) -> tuple[VehicleSpec, ...]:
    """Draw two or three crashed cars, clear of the area's guards; with ``has_help``, an emergency vehicle first."""
    rng = stream(seed, f"{name}.vehicles")
    row = _VehicleRow(area, guards, area.body_m[0] + _END_MARGIN_M, area.body_m[1] - _END_MARGIN_M)
    if has_help:
        row.place(
            _draw_blueprint([each for each in load_blueprints() if each.emergency and row.has_width_for(each)], rng),
            0.0,
            0.0,
            rng,
        )
    cars = [
        each for each in load_blueprints() if each.tag == Tag.CAR and not each.emergency and row.has_width_for(each)
    ]
    crash_rad = np.radians(_CRASHES_DEG[int(rng.integers(len(_CRASHES_DEG)))])
    for number in range(3 if rng.random() < _THIRD_CAR else 2):
        gap_m = rng.uniform(*(_CRASH_GAP_M if number else _HELP_GAP_M)) if row.vehicles else 0.0
        turn_rad = rng.choice([-1.0, 1.0]) * rng.uniform(*(crash_rad if number else np.radians(_CRASHES_DEG[0])))
        row.place(_draw_blueprint(cars, rng), gap_m, turn_rad, rng, crashed=True)
    return tuple(row.vehicles)


def place_work_vehicles(area: HazardArea, guards: BaseGeometry, seed: int, name: str) -> tuple[VehicleSpec, ...]:
    """Draw one or two vehicles of road works, such as a tipper and an excavator, clear of the area's guards."""
    rng = stream(seed, f"{name}.vehicles")
    row = _VehicleRow(
        area, guards, area.body_m[0] + BARRIER_ROW_M + _END_MARGIN_M, area.body_m[1] - BARRIER_ROW_M - _END_MARGIN_M
    )
    for preferred in _WORK_VEHICLES[int(rng.integers(len(_WORK_VEHICLES)))]:
        candidates = [blueprint_named(each) for each in (preferred, *_NARROW_WORK_VEHICLES)]
        blueprint = next((each for each in candidates if row.has_width_for(each)), candidates[-1])
        row.place(blueprint, rng.uniform(*_WORK_GAP_M), 0.0, rng)
    return tuple(row.vehicles)


class _VehicleRow:
    """Vehicles one behind the other in the body of an area, from ``start_m`` to ``end_m`` behind its tip."""

    def __init__(self, area: HazardArea, guards: BaseGeometry, start_m: float, end_m: float) -> None:
        self._area = area
        self._inside = shapely.Polygon(area.outline_m).buffer(-_CLEARANCE_M).difference(guards.buffer(_CLEARANCE_M))
        shapely.prepare(self._inside)
        self._begin_m, self._end_m = start_m, end_m
        self._last: BaseGeometry = shapely.Polygon()
        self.vehicles: list[VehicleSpec] = []

    def has_width_for(self, blueprint: Blueprint) -> bool:
        """Whether the area is wide enough for a vehicle."""
        return blueprint.size_m[1] + 2.0 * _CLEARANCE_M <= self._area.usable_width_m

    def place(
        self, blueprint: Blueprint, gap_m: float, turn_rad: float, rng: np.random.Generator, crashed: bool = False
    ) -> None:
        """Place a vehicle behind the last one with a gap, turned as far as there is room; without room, omit it."""
        for turn in (turn_rad * _TURN_REDUCTION ** np.arange(_TRIES)).tolist():
            half_m = (blueprint.size_m[0] * abs(math.cos(turn)) + blueprint.size_m[1] * abs(math.sin(turn))) / 2.0
            along_m = np.arange(self._begin_m + half_m, self._end_m - half_m, _STEP_M)
            position_m, yaw_rad = self._area.positions(along_m, np.full(len(along_m), self._area.usable_width_m / 2.0))
            boxes = footprints(np.array(blueprint.size_m), position_m, yaw_rad + turn)
            apart = self._last.is_empty | (shapely.distance(boxes, self._last) >= gap_m)
            room = np.flatnonzero(apart & shapely.covers(self._inside, boxes))
            if len(room):
                index = int(room[0])
                self._begin_m, self._last = float(along_m[index]), boxes[index]
                x_m, y_m, z_m = position_m[index].tolist()
                stand = StandSpec(
                    x_m=x_m,
                    y_m=y_m,
                    z_m=z_m,
                    yaw_rad=float(yaw_rad[index]) + turn,
                    hazard_lights=not blueprint.emergency,
                    open_doors=self._draw_open_doors(blueprint, rng) if crashed else 0,
                )
                self.vehicles.append(self._vehicle(blueprint, stand, self._area.from_s_m + float(along_m[index]), rng))
                return

    def _draw_open_doors(self, blueprint: Blueprint, rng: np.random.Generator) -> int:
        """Draw the bits of open doors among those away from the traffic, which are all even-numbered or all odd."""
        far_side = [door for door in range(blueprint.doors) if door % 2 == (self._area.side > 0)]
        is_open = rng.random(len(far_side)) < _OPEN_DOOR
        return sum(1 << door for door, door_is_open in zip(far_side, is_open.tolist(), strict=True) if door_is_open)

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


def _draw_blueprint(blueprints: list[Blueprint], rng: np.random.Generator) -> Blueprint:
    """Draw one of the blueprints, weighted by frequency."""
    cumulative = np.cumsum([blueprint.frequency for blueprint in blueprints])
    return blueprints[int(np.searchsorted(cumulative, rng.random() * cumulative[-1], side="right"))]
