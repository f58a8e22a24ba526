"""Draw one vehicle and its driver; every value of the driver comes from a random stream of its own."""

from typing import TypedDict, get_args

import numpy as np

from simbev_ros.config.draw import sample
from simbev_ros.config.traffic import Traffic
from simbev_ros.foundation.random import stream
from simbev_ros.scene.blueprints import Blueprint
from simbev_ros.schema.scene.spec import Ignored, VehicleSpec, WaypointSpec


class DriverFields(TypedDict):
    """Fields of a ``VehicleSpec`` that describe the driver."""

    headway_s: float
    lane_change_eagerness: float
    distracted: bool
    ignores: tuple[Ignored, ...]
    emergency_lights: bool
    door_probability: float


def draw_driver(
    traffic: Traffic, blueprint: Blueprint, seed: int, name: str, *, opens_doors: bool = True
) -> DriverFields:
    """Draw the driver of the vehicle ``name``: ``ego``, ``agents.<name>`` or ``vehicles.<number>``."""

    def draw_flag(name_suffix: str, probability: float) -> bool:
        return bool(stream(seed, f"{name}.{name_suffix}").random() < probability)

    return DriverFields(
        headway_s=sample(traffic.headway_s, stream(seed, f"{name}.headway")),
        lane_change_eagerness=sample(traffic.lane_change_eagerness, stream(seed, f"{name}.eagerness")),
        distracted=draw_flag("distraction", traffic.distracted_probability),
        ignores=tuple(
            each
            for each in get_args(Ignored)
            if draw_flag(f"ignores_{each}", getattr(traffic, f"ignore_{each}_probability"))
        ),
        emergency_lights=blueprint.emergency and draw_flag("emergency_lights", traffic.emergency_lights_probability),
        door_probability=traffic.door_probability if opens_doors else 0.0,
    )


def draw_vehicle(
    traffic: Traffic,
    blueprint: Blueprint,
    start: WaypointSpec,
    rng: np.random.Generator,
    reckless_probability: float,
    driver: DriverFields,
) -> VehicleSpec:
    """Draw the remaining fields of a vehicle with this blueprint, start and driver from one random stream."""
    return VehicleSpec(
        blueprint=blueprint.name,
        color=blueprint.colors[int(rng.integers(len(blueprint.colors)))],
        start=start,
        speed_factor=sample(traffic.speed_factor, rng),
        min_gap_m=sample(traffic.min_gap_m, rng),
        reckless=bool(rng.random() < reckless_probability),
        **driver,
    )
