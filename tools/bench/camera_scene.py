"""A simulated scene for benchmarks without a graph: the static scene and some moments of traffic around the ego."""

from collections.abc import Sequence
from dataclasses import dataclass

from simbev_ros.assets.placement.static_scene import StaticScene
from simbev_ros.assets.regions.static_cache import load_static_scene, load_streetside
from simbev_ros.config.camera import Camera
from simbev_ros.config.hazards import Hazards
from simbev_ros.config.load import load_scenario
from simbev_ros.config.scenario import MapScenes, Timing
from simbev_ros.config.traffic import Traffic
from simbev_ros.config.weather import WeatherConfig
from simbev_ros.foundation.process_memory import freeze_after_loading
from simbev_ros.maps.build import load_network
from simbev_ros.maps.source import known_map
from simbev_ros.production.drawing import draw_scenes
from simbev_ros.production.graph_timing import DAY
from simbev_ros.production.observer import SILENT, ProductionObserver, observe_step
from simbev_ros.production.surroundings import build_surroundings
from simbev_ros.scene.reach import loaded_reach
from simbev_ros.schema.scene.lights import LightSpec
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.simulation.world.simulation import Simulation

_WARM_UP_S = 4.0


@dataclass(frozen=True, slots=True)
class CameraScene:
    """The input of a renderer.

    Attributes:
        map: Name of the town.
        static: Its static scene near the ego.
        lights: Street lights and windows.
        states: States of the world, one tick apart.
    """

    map: str
    static: StaticScene
    lights: LightSpec
    states: Sequence[WorldState]


def camera_scene(
    map_name: str,
    actors: int,
    moments: int,
    observer: ProductionObserver = SILENT,
    weather: WeatherConfig = DAY,
    *,
    vehicle_share: float = 0.5,
    spawn_radius_m: float = 400.0,
    spacing_m: float = 24.0,
) -> CameraScene:
    """Simulate traffic on a map without hazard areas.

    Args:
        map_name: A town or a map file.
        actors: Number of vehicles and pedestrians; riders come on top.
        moments: Number of states after the warm-up.
        observer: Receives the progress.
        weather: The weather of the scene.
        vehicle_share: Share of vehicles among the actors.
        spawn_radius_m: Radius around the ego in which actors start.
        spacing_m: Minimum distance between the start positions of vehicles.

    Raises:
        InputError: The map does not exist, or has no room for that many actors.
    """
    vehicles = int(actors * vehicle_share)
    traffic = Traffic(
        vehicles=vehicles, pedestrians=actors - vehicles, spawn_radius_m=spawn_radius_m, waypoint_spacing_m=spacing_m
    )
    time = Timing(warm_up_s=_WARM_UP_S, duration_s=4.0)
    update = {
        "scenes": (MapScenes(map=known_map(map_name), train=1),),
        "traffic": traffic,
        "time": time,
        "weather": weather,
    }
    scenario = load_scenario("paper").model_copy(update={**update, "hazards": Hazards(count=0)})
    [spec] = draw_scenes(scenario, observer)
    build_surroundings([spec], observer)
    network = load_network(spec.map)
    reach = loaded_reach(spec, network)
    beside = load_streetside(spec.map, network, reach=reach)
    with observe_step(observer, "traffic"):
        with freeze_after_loading():
            simulation = Simulation(spec, network, *beside[1:])
        with simulation:
            states = [simulation.step() for _ in range(spec.warm_up_ticks + moments)][-moments:]
    static = load_static_scene(spec.map, network, reach=reach)
    return CameraScene(spec.map.name, static, spec.lights, states)


def paper_cameras() -> list[Camera]:
    """The six camera poses of the paper's rig, each with all five modalities."""
    return list(load_scenario("paper").rig.of_type(Camera))
