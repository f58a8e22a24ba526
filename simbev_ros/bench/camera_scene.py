"""A scene to draw without a graph: some moments of traffic around the ego, by day, and all that stands there."""

from collections.abc import Sequence
from dataclasses import dataclass

from rich.console import Console

from simbev_ros.assets.placement.static_scene import StaticScene
from simbev_ros.assets.regions.static_cache import load_static_scene, load_streetside
from simbev_ros.cli.scenes import build_surroundings, drawn_scenes
from simbev_ros.config.camera import Camera
from simbev_ros.config.hazards import Hazards
from simbev_ros.config.load import load_scenario
from simbev_ros.config.scenario import MapScenes, Timing, Traffic, WeatherConfig
from simbev_ros.maps.build import load_network
from simbev_ros.scene.lights import LightSpec
from simbev_ros.scene.reach import loaded_reach
from simbev_ros.scene.state import WorldState
from simbev_ros.world.simulation import Simulation

_WARM_UP_S = 4.0
_DAY = WeatherConfig(
    cloudiness=20,
    precipitation=0,
    precipitation_deposits=0,
    wetness=0,
    wind_intensity=10,
    sun_azimuth_deg=160,
    sun_altitude_deg=45,
    fog_density=0,
    fog_distance_m=0,
    fog_falloff=1,
)


@dataclass(frozen=True, slots=True)
class CameraScene:
    """What a renderer needs.

    Attributes:
        map: The town's name.
        static: What stands there.
        lights: Street lights and windows.
        states: Moments, a tick apart.
    """

    map: str
    static: StaticScene
    lights: LightSpec
    states: Sequence[WorldState]


def camera_scene(
    map_name: str,
    actors: int,
    moments: int,
    console: Console,
    weather: WeatherConfig = _DAY,
    *,
    vehicle_share: float = 0.5,
    spawn_radius_m: float = 400.0,
    spacing_m: float = 24.0,
) -> CameraScene:
    """Simulate traffic on a map, by default half of it vehicles, half people on foot; there are no hazard areas.

    Raises:
        InputError: There is no such map, or it has no room for so many.
    """
    vehicles = int(actors * vehicle_share)
    traffic = Traffic(
        vehicles=vehicles, pedestrians=actors - vehicles, spawn_radius_m=spawn_radius_m, waypoint_spacing_m=spacing_m
    )
    time = Timing(warm_up_s=_WARM_UP_S, duration_s=4.0)
    update = {"scenes": (MapScenes(map=map_name, train=1),), "traffic": traffic, "time": time, "weather": weather}
    scenario = load_scenario("paper").model_copy(update={**update, "hazards": Hazards(count=0)})
    [spec] = drawn_scenes(scenario, console)
    build_surroundings([spec], console)
    network = load_network(spec.map)
    reach = loaded_reach(spec, network)
    beside = load_streetside(spec.map, network, reach=reach)
    with console.status("traffic"), Simulation(spec, network, beside.obstacles, beside.plazas) as simulation:
        states = [simulation.step() for _ in range(spec.warm_up_ticks + moments)][-moments:]
    static = load_static_scene(spec.map, network, reach=reach)
    return CameraScene(spec.map.name, static, spec.lights, states)


def paper_cameras() -> list[Camera]:
    """The six camera poses of the paper's rig, each with all five modalities."""
    return list(load_scenario("paper").rig.of_type(Camera))
