"""How one vehicle is driven: drawn values, each from a stream of its own."""

from typing import TypedDict

from simbev_ros.config.draw import sample
from simbev_ros.config.scenario import Traffic
from simbev_ros.random import stream
from simbev_ros.scene.blueprints import Blueprint


class Driver(TypedDict):
    """Fields of a ``VehicleSpec``."""

    headway_s: float
    lane_change_eagerness: float
    distracted: bool
    emergency_lights: bool
    door_probability: float


def draw_driver(traffic: Traffic, blueprint: Blueprint, seed: int, name: str) -> Driver:
    """Draw the driver of the vehicle ``name``: ``ego`` or ``vehicles.<number>``. The ego's doors stay shut."""

    def happens(what: str, probability: float) -> bool:
        return bool(stream(seed, f"{name}.{what}").random() < probability)

    return Driver(
        headway_s=sample(traffic.headway_s, stream(seed, f"{name}.headway")),
        lane_change_eagerness=sample(traffic.lane_change_eagerness, stream(seed, f"{name}.eagerness")),
        distracted=happens("distraction", traffic.distracted_probability),
        emergency_lights=blueprint.emergency and happens("emergency_lights", traffic.emergency_lights_probability),
        door_probability=0.0 if name == "ego" else traffic.door_probability,
    )
