"""Small scenes for the tests of the world package: a hand-made specification on a small town."""

from functools import cache

import numpy as np
from made_up_roads import clear_weather
from scene_edits import ego

from simbev_ros.foundation.types import Table
from simbev_ros.maps.build import load_network
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.scene.blueprints import load_blueprints
from simbev_ros.schema.scene.map_spec import MapSpec
from simbev_ros.schema.scene.spec import PedestrianSpec, SceneSpec, VehicleSpec, WaypointSpec
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.simulation.world.simulation import Simulation

TICK_S = 0.05
BLOCKS = MapSpec(name="Blocks", seed=0)
NOON = clear_weather()


@cache
def blocks() -> RoadNetwork:
    return load_network(BLOCKS)


def scene(vehicles: int = 32, pedestrians: int = 24, ticks: int = 160, **changes: object) -> SceneSpec:
    """A sedan, then every kind of vehicle in turn, and pedestrians on random sidewalks."""
    rng = np.random.default_rng(5)
    waypoints = blocks().waypoints(24.0)
    waypoint_indices = rng.permutation(len(waypoints.lane))
    sidewalks = [lane for lane in blocks().lanes.values() if lane.kind is LaneKind.SIDEWALK]
    cars = [blueprint.name for blueprint in load_blueprints() if blueprint.kind == "vehicle"]
    pedestrian_names = [blueprint.name for blueprint in load_blueprints() if blueprint.on_foot or blueprint.wheelchair]
    fields: dict[str, object] = {
        "number": 0,
        "split": "train",
        "seed": 7,
        "map": BLOCKS,
        "tick_ns": round(TICK_S * 1e9),
        "warm_up_ticks": 40,
        "ticks": ticks,
        "weather": NOON,
        "agents": [ego()],
        "vehicles": tuple(
            VehicleSpec(
                blueprint=cars[index % len(cars)] if index else "vehicle.sedan",
                color=0x336699,
                start=WaypointSpec(lane=waypoints.lane[waypoint_index], s_m=float(waypoints.s_m[waypoint_index])),
                speed_factor=float(rng.uniform(0.8, 1.4)),
                min_gap_m=float(rng.uniform(1.5, 5.0)),
            )
            for index, waypoint_index in enumerate(waypoint_indices[:vehicles])
        ),
        "pedestrians": tuple(
            PedestrianSpec(
                blueprint=pedestrian_names[index % len(pedestrian_names)],
                color=0x112233,
                start=WaypointSpec(lane=lane.id, s_m=float(rng.uniform(1.0, lane.length_m - 1.0))),
                max_speed_mps=float(rng.uniform(0.8, 2.2)),
            )
            for index in range(pedestrians)
            for lane in [sidewalks[int(rng.integers(len(sidewalks)))]]
        ),
        "green_time_s": (4.0, 6.5, 5.25),
    }
    return SceneSpec.model_validate({**fields, **changes})


def run(spec: SceneSpec) -> list[WorldState]:
    """All states of a scene, warm-up included."""
    with Simulation(spec, blocks()) as simulation:
        return [simulation.step() for _ in range(spec.warm_up_ticks + spec.ticks)]


@cache
def busy_run() -> tuple[SceneSpec, Table]:
    """A scene and its (T, N) actors."""
    spec = scene()
    return spec, np.stack([state.actors for state in run(spec)])


def of_kind(actors: Table, kind: str) -> Table:
    """The (T, M) columns of one kind of actor: vehicle, rider or pedestrian."""
    kinds = np.array([blueprint.kind for blueprint in load_blueprints()])
    return actors[:, kinds[actors["blueprint"][0]] == kind]
