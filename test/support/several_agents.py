"""Scenes with several agents: vehicles and a roadside unit, each with a rig of its own."""

from functools import cache
from typing import Any

from made_up_scene import SENSORS, made_up_spec

from simbev_ros.config.load import load_scenario
from simbev_ros.maps.build import load_network
from simbev_ros.scene.drawing.draw_scene import draw_scene, planned_scenes
from simbev_ros.schema.scene.spec import SceneSpec

MAST_SENSORS: list[dict[str, Any]] = [
    {"type": "camera", "name": "cam", "pose": {"z_m": 6, "pitch_deg": 30}, "width_px": 32, "height_px": 24},
    {"type": "lidar", "name": "lidar", "pose": {"z_m": 6.2}},
]


def car(name: str, vehicle: int, sensors: list[dict[str, Any]] = SENSORS, **changes: Any) -> dict[str, Any]:
    """An agent that rides in a vehicle of the scene."""
    return {"rig": {"agent": name, "sensors": sensors}, "annotation": {}, "vehicle": vehicle} | changes


def roadside_unit(
    name: str = "rsu", sensors: list[dict[str, Any]] = MAST_SENSORS, *, x_m: float = 12.0, y_m: float = -3.0
) -> dict[str, Any]:
    """An agent on a mast, whose foot is at a height of 1 m and whose x axis is at 1.5 rad."""
    station = {"x_m": x_m, "y_m": y_m, "z_m": 1.0, "yaw_rad": 1.5}
    return {"rig": {"agent": name, "sensors": sensors}, "annotation": {}, "station": station}


def with_agents(spec: SceneSpec, *agents: dict[str, Any]) -> SceneSpec:
    """The scene with its ego and these other agents."""
    data = spec.model_dump(mode="json")
    return SceneSpec.model_validate(data | {"agents": [data["agents"][0], *agents]})


def made_up_agents() -> SceneSpec:
    """A scene that nobody has drawn, with agents ``ego`` in vehicle 0, ``car`` in vehicle 2, and ``rsu``."""
    return with_agents(made_up_spec(SENSORS, number=2), car("car", 2), roadside_unit())


@cache
def blocks_agents() -> SceneSpec:
    """The demo's scene on the map Blocks with three cars, ``ego``, ``car_1`` and ``car_2``, and a mast beside the road.

    Their rigs are equal but for the mast's, which has a camera and a lidar.
    """
    scenario = load_scenario("demo")
    planned = next(planned_scenes(scenario))
    spec = draw_scene(scenario, planned, load_network(planned.map))
    sensors = spec.agents[0].rig.model_dump(mode="json")["sensors"]
    return with_agents(spec, car("car_1", 1, sensors), car("car_2", 2, sensors), roadside_unit())
