"""Scenes on map files: configured, drawn, and driven for ten seconds."""

import re
from pathlib import Path

import libsumo
import numpy as np
import pytest
import shapely
from lanelet2_sample import Crossing, LaneletSample
from sumo_nets import generate_net

from simbev_ros.assets.placement.region_ground import LAND_HEIGHT_M
from simbev_ros.config.load import load_scenario
from simbev_ros.foundation.errors import InputError
from simbev_ros.maps.build import load_network
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.surface import strip_polygons
from simbev_ros.scene.blueprints import load_blueprints
from simbev_ros.scene.drawing.draw_scene import PlannedScene, draw_scene, planned_scenes
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.simulation.world.simulation import Simulation

SAMPLE = Path(__file__).parents[2] / "maps/data/riverside.osm"
CONFIG = """scenes: [{map: maps/%s, train: 1}]
rig: {sensors: [{type: imu, name: imu}]}
time: {tick_s: 0.1, warm_up_s: 1, duration_s: 10}
traffic: {vehicles: 25, pedestrians: 25, spawn_radius_m: 300, reckless_probability: 0}
"""


def configured(folder: Path, map_name: str) -> PlannedScene:
    """The scene of a configuration in ``folder`` whose map lies in the sub-folder ``maps``."""
    (folder / "config.yaml").write_text(CONFIG % map_name)
    (planned,) = planned_scenes(load_scenario(folder / "config.yaml"))
    return planned


def map_file(folder: Path, options: str) -> str:
    """Create ``maps/<name>``, with netgenerate or from the sample; returns the name."""
    (folder / "maps").mkdir()
    if options.startswith("lanelets"):
        crossing = Crossing(LaneletSample(), length_m=250.0, height=lambda x, y: 0.05 * max(0.0, x - 40.0))
        for arm in range(4):
            crossing.lights(arm)
            crossing.crosswalk(arm)
            if options == "lanelets":
                crossing.walkways(arm)
        (folder / "maps/lanelets.osm").write_text(crossing.sample.text())
        return "lanelets.osm"
    if options == "sample":
        (folder / "maps/riverside.osm").symlink_to(SAMPLE)
        return "riverside.osm"
    generate_net(folder / "maps/made by sumo.net.xml", *options.split())
    return "made by sumo.net.xml"


def drive(folder: Path, planned: PlannedScene) -> list[WorldState]:
    network = load_network(planned.map, folder / "cache")
    spec = draw_scene(load_scenario(folder / "config.yaml"), planned, network)
    with Simulation(spec, network) as simulation:
        return [simulation.step() for _ in range(spec.warm_up_ticks + spec.ticks)]


@pytest.mark.parametrize(
    "options",
    [
        "sample",
        "lanelets",
        pytest.param("--spider", marks=pytest.mark.slow),
        pytest.param("--grid", marks=pytest.mark.slow),
        pytest.param("--rand --rand.iterations 40 --seed 4", marks=pytest.mark.slow),
    ],
)
def test_a_scene_on_a_file_spawns_and_drives(tmp_path: Path, options: str) -> None:
    planned = configured(tmp_path, map_file(tmp_path, options))
    assert re.fullmatch(r"riverside|lanelets|made_by_sumo", planned.map.name)
    states = drive(tmp_path, planned)
    kinds = np.array([blueprint.kind for blueprint in load_blueprints()])
    first, last = (state.actors[kinds[state.actors["blueprint"]] != "prop"] for state in (states[0], states[-1]))
    assert np.array_equal(first["id"], last["id"])
    assert len(first) >= 45
    moved_m = np.hypot(last["x"] - first["x"], last["y"] - first["y"])
    assert np.mean(moved_m > 3.0) > 0.7
    speeds_mps = np.array([np.hypot(state.actors["vx"], state.actors["vy"]) for state in states])
    assert speeds_mps.max() < 45.0


def test_on_a_map_without_sidewalks_people_walk_on_the_verges(tmp_path: Path) -> None:
    planned = configured(tmp_path, map_file(tmp_path, "lanelets without walkways"))
    states = drive(tmp_path, planned)
    kinds = np.array([blueprint.kind for blueprint in load_blueprints()])
    people = np.stack([state.actors[kinds[state.actors["blueprint"]] == "pedestrian"] for state in states])
    assert people.shape[1] == 25
    network = load_network(planned.map, tmp_path / "cache")
    road = shapely.union_all(strip_polygons(network.layout.strips_of(LaneKind.DRIVING)))
    from_road_m = shapely.distance(road, shapely.points(people["x"], people["y"]))
    assert np.mean(from_road_m == 0.0) < 0.15, "only to cross"
    assert from_road_m.max() < 6.0
    on_land = from_road_m > 0.3
    road_m = network.elevation.height_m(np.column_stack([people["x"][on_land], people["y"][on_land]]), 0)
    np.testing.assert_allclose(people["z"][on_land] - road_m, LAND_HEIGHT_M, atol=0.03)
    assert np.hypot(*(people[name][-1] - people[name][0] for name in "xy")).mean() > 3.0


@pytest.mark.slow
@pytest.mark.parametrize("side", ["", "--lefthand"])
def test_vehicles_change_lanes_to_the_side_that_sumo_means(tmp_path: Path, side: str) -> None:
    planned = configured(tmp_path, map_file(tmp_path, f"--grid --grid.number 3 -L3 --no-turnarounds {side}"))
    network = load_network(planned.map, tmp_path / "cache")
    spec = draw_scene(load_scenario(tmp_path / "config.yaml"), planned, network)
    apart_m, lateral_m = [], []
    with Simulation(spec, network) as simulation:
        for _ in range(100):
            simulation.step()
            names = [name for name in libsumo.vehicle.getIDList() if libsumo.vehicle.getLaneID(name)[0] != ":"]
            front_m = dict(zip(simulation._sumo._vehicle_names, simulation._sumo.sample().front_m, strict=True))
            apart_m += [np.linalg.norm(front_m[name][:2] - libsumo.vehicle.getPosition(name)) for name in names]
            lateral_m += [abs(libsumo.vehicle.getLateralLanePosition(name)) for name in names]
    assert max(lateral_m) > 1.0
    assert max(apart_m) < 0.5


def test_a_file_that_changed_since_the_scene_was_drawn_is_refused(tmp_path: Path) -> None:
    planned = configured(tmp_path, map_file(tmp_path, "--grid --grid.number 3"))
    path = tmp_path / "maps/made by sumo.net.xml"
    path.write_text(path.read_text() + "\n")
    with pytest.raises(InputError, match=r"made by sumo\.net\.xml: has changed since the scene was drawn"):
        load_network(planned.map, tmp_path / "cache")


def test_a_missing_map_is_refused_with_its_line(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"config\.yaml:1: scenes\[0\]\.map: no such file: .*maps/my\.xodr"):
        configured(tmp_path, "my.xodr")
