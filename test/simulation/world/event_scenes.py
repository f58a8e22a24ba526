"""Small scenes with one drawn event on a route, and an ego that drives along it from outside."""

from collections.abc import Sequence
from functools import cache

from driven_routes import drive_of, route_along
from scene_edits import ego
from world_scenes import BLOCKS, blocks, scene

from simbev_ros.config.rig import Rig
from simbev_ros.config.scenario import Scenario
from simbev_ros.maps.build import load_network
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.source import map_spec
from simbev_ros.scene.drawing.draw_events import draw_events
from simbev_ros.scene.drawing.start_clearance import StartClearance
from simbev_ros.schema.scene.spec import SceneSpec, VehicleSpec, WaypointSpec

TWO_LANES = ("grid.ns2.0.0", "grid.ns2.0.1", "grid.ns2.0.2", "grid.ns2.0.3")
LEFT = ("grid.ns2.0.0", "-grid.ew1.0.1")
RIGHT = ("grid.ns2.0.0", "grid.ew1.0.2")
BENDS = ("grid.ring.7", "grid.ring.8")


@cache
def town(name: str) -> RoadNetwork:
    return load_network(map_spec(name))


def event_scene(
    kind: str,
    edges: Sequence[str],
    lane: int = 1,
    seed: int = 0,
    ticks: int = 500,
    s_m: float = 10.0,
    town_name: str = "",
    **changes: object,
) -> SceneSpec:
    """A sedan on a route along edges, with one event of a kind, and nobody else."""
    network = town(town_name) if town_name else blocks()
    first = f"{edges[0]}_{lane}"
    drive = {"events": {"count": 1, "kinds": [kind]}}
    scenes = [{"map": town_name or "Blocks", "train": 1}]
    scenario = Scenario.model_validate({"scenes": scenes, "rig": Rig(sensors=()), "drive": drive})
    start = WaypointSpec(lane=first, s_m=s_m)
    sedan = VehicleSpec(blueprint="vehicle.sedan", color=0x336699, start=start, speed_factor=1.0, min_gap_m=2.0)
    route = route_along(network, edges, first, s_m)
    drawn = draw_events(scenario, seed, network, route, (sedan,), (), StartClearance(network, (sedan,)))
    spec = scene(vehicles=1, pedestrians=0, ticks=ticks, agents=[ego(driver="twist")])
    changes = {"map": map_spec(town_name) if town_name else BLOCKS, "drive": drive_of(route, drawn.events)} | changes
    actors = {"vehicles": (sedan, *drawn.vehicles), "pedestrians": drawn.pedestrians}
    return spec.model_copy(update=actors | changes)
