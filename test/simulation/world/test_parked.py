"""Parked vehicles stand where nobody drives or walks, and never move."""

import numpy as np
import pytest
import shapely

from simbev_ros.assets.regions.static_cache import load_streetside
from simbev_ros.assets.street.parking_spots import SPOT_DTYPE, SpotKind
from simbev_ros.config.hazards import Hazards
from simbev_ros.config.load import load_scenario
from simbev_ros.config.scenario import MapScenes, Timing
from simbev_ros.config.traffic import Parked, Traffic
from simbev_ros.foundation.types import AnyArray, Table
from simbev_ros.maps.build import load_network
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.surface import strip_polygons
from simbev_ros.scene.blueprints import load_blueprints
from simbev_ros.scene.drawing.draw_scene import draw_scene, planned_scenes
from simbev_ros.scene.footprints import footprints
from simbev_ros.scene.reach import loaded_reach
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import ACTOR_DTYPE, Behavior
from simbev_ros.simulation.world.parked import MAX_PARKED, ParkedVehicles, _take_spots
from simbev_ros.simulation.world.simulation import Simulation

_LEVEL_TOLERANCE_M = 2.0


def scene(town: str, density: float = 1.0, hazards: int = 0, seed: int = 1) -> tuple[SceneSpec, RoadNetwork, Table]:
    """A scene with much traffic, its roads and its parking spots."""
    update = {
        "seed": seed,
        "scenes": (MapScenes(map=town, train=1),),
        "traffic": Traffic(vehicles=100, pedestrians=200, spawn_radius_m=200.0, parked=Parked(density=density)),
        "time": Timing(warm_up_s=2.0, duration_s=10.0),
        "hazards": Hazards(count=hazards),
    }
    scenario = load_scenario("paper").model_copy(update=update)
    [planned] = planned_scenes(scenario)
    network = load_network(planned.map)
    spec = draw_scene(scenario, planned, network)
    spots = load_streetside(spec.map, network, reach=loaded_reach(spec, network)).parking_spots
    return spec, network, spots


def ground(actors: Table) -> AnyArray:
    """Footprints of the boxes of actors."""
    size_m = np.column_stack([actors["length"], actors["width"]])
    return footprints(size_m, np.column_stack([actors["x"], actors["y"]]), actors["yaw"].astype(np.float64))


def parked_of(actors: Table) -> Table:
    return actors[actors["behavior"] & Behavior.PARKED > 0]


@pytest.mark.parametrize("town", ["Town02", pytest.param("Town03", marks=pytest.mark.slow)])
def test_no_actor_ever_touches_a_parked_vehicle(town: str) -> None:
    spec, network, spots = scene(town, hazards=1)
    with Simulation(spec, network, parking_spots=spots) as simulation:
        states = [simulation.step() for _ in range(spec.warm_up_ticks + spec.ticks)]
    parked = parked_of(states[0].actors)
    tree = shapely.STRtree(ground(parked))
    assert len(parked) > 20
    for state in states:
        others = state.actors[state.actors["behavior"] & Behavior.PARKED == 0]
        inner = shapely.buffer(ground(others), -0.02)  # a box is as wide as an umbrella, which is above the cars
        other, row = tree.query(inner, predicate="intersects")
        assert not np.any(np.abs(others["z"][other] - parked["z"][row]) < _LEVEL_TOLERANCE_M)


def test_parked_vehicles_never_move_and_have_ids_of_their_own() -> None:
    spec, network, spots = scene("Town02")
    with Simulation(spec, network, parking_spots=spots) as simulation:
        states = [simulation.step() for _ in range(60)]
    first, last = parked_of(states[0].actors), parked_of(states[-1].actors)
    still = [name for name in ACTOR_DTYPE.names or () if name != "doors"]
    assert np.array_equal(first[still], last[still])
    assert not any(first[name].any() for name in ("vx", "vy", "vz", "ax", "wz", "lights"))
    assert np.all(np.diff(states[-1].actors["id"].astype(np.int64)) > 0)


def test_parked_vehicles_keep_off_all_lanes_of_traffic_and_off_each_other() -> None:
    spec, network, spots = scene("Town02")
    shapes = ground(ParkedVehicles(spec, network, spots, {}, 1).rows)
    lanes = strip_polygons(network.layout.strips_of(LaneKind.DRIVING, LaneKind.BICYCLE, LaneKind.SIDEWALK, level=0))
    assert not len(shapely.STRtree(lanes).query(shapes, predicate="intersects")[0])
    assert len(shapely.STRtree(shapes).query(shapes, predicate="intersects")[0]) == len(shapes)


def test_vehicles_at_a_curb_head_along_their_lane_with_few_exceptions() -> None:
    spec, network, spots = scene("Town02")
    curbs = spots[spots["kind"] == SpotKind.CURB]
    rows = ParkedVehicles(spec, network, curbs, {}, 1).rows
    lane = network.nearest_lane(np.column_stack([rows["x"], rows["y"]]))
    along = np.cos(rows["yaw"] - lane.yaw_rad)
    assert np.all(np.abs(along) > np.cos(0.1))
    assert 0.85 < np.mean(along > 0.0) <= 1.0


def test_the_density_is_the_share_of_taken_spots() -> None:
    counts = []
    for density in (0.0, 0.5, 1.0):
        spec, network, spots = scene("Town02", density)
        counts.append(len(ParkedVehicles(spec, network, spots, {}, 1).rows))
    assert counts[0] == 0
    assert 0.35 < counts[1] / counts[2] < 0.65
    assert counts[2] <= MAX_PARKED


def test_without_spots_nothing_is_parked() -> None:
    spec, network, _ = scene("Town02")
    assert len(ParkedVehicles(spec, network, np.zeros(0, SPOT_DTYPE), {}, 1).rows) == 0


def test_doors_open_only_while_nobody_is_near() -> None:
    spec, network, spots = scene("Town02")
    vehicles = ParkedVehicles(spec, network, spots, {}, 1)
    nobody, beside = np.zeros(0, ACTOR_DTYPE), np.zeros(len(vehicles.rows), ACTOR_DTYPE)
    beside["x"], beside["y"] = vehicles.rows["x"] + 2.0, vehicles.rows["y"]
    steps = range(0, spec.warm_up_ticks + spec.ticks, 10)
    assert any(vehicles.rows_at(step, nobody)["doors"].any() for step in steps)
    assert not any(vehicles.rows_at(step, beside)["doors"].any() for step in steps)


def test_a_few_trailers_and_no_tractors_stand_among_parked_vehicles() -> None:
    spots = np.zeros(4000, SPOT_DTYPE)
    spots["x"], spots["length"], spots["width"], spots["kind"] = np.arange(4000) * 10.0, 7.0, 3.0, SpotKind.BAY
    spec, _, _ = scene("Town02")
    rows = np.concatenate([_take_spots(spec, spots[k : k + 1]) for k in range(len(spots))])
    kinds = [load_blueprints()[index] for index in rows["blueprint"].tolist()]
    trailers = np.array([kind.kind == "trailer" for kind in kinds])
    assert 0.005 < trailers.mean() < 0.025
    assert not np.any(rows["steer"][trailers])
    assert not any(kind.land for kind in kinds)
