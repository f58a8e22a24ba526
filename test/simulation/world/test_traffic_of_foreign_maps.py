"""On maps of strangers, traffic keeps moving for minutes, and nobody drives through walls."""

from pathlib import Path

import numpy as np
import pytest
import shapely
from world_scenes import of_kind

from simbev_ros.assets.regions.static_cache import load_static_scene
from simbev_ros.config.rig import Rig
from simbev_ros.config.scenario import Scenario
from simbev_ros.foundation.geometry.plan_view import left_of
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Float64Array, Table
from simbev_ros.maps.build import load_network
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.source import map_spec
from simbev_ros.maps.sumo.netconvert import sumo_home
from simbev_ros.scene.drawing.draw_scene import PlannedScene, draw_scene
from simbev_ros.schema.scene.state import EGO_ID
from simbev_ros.simulation.world.simulation import Simulation

TESTS = Path(__file__).parents[2]
SHARED = TESTS.parent.parent / "shared/maps"
GAMES = sumo_home() / "tools/game"
CITIES = [
    GAMES / "A10KW/osm.net.xml",
    GAMES / "DRT/osm.net.xml",
    GAMES / "bs3d/bs.net.xml",
    GAMES / "fkk_in/ingolstadt.net.xml.gz",
    SHARED / "foreign/chatt.xodr",
    SHARED / "foreign/doerpfeldstr.net.xml",
    SHARED / "foreign/flow_test2.net.xml",
    SHARED / "foreign/sievekingplatz.net.xml",
    SHARED / "carla/Town01.xodr",
    SHARED / "carla/Town04.xodr",
    TESTS / "maps/data/riverside.osm",
]
OPEN_ENDS = [SHARED / f"foreign/{name}.xodr" for name in ("borregasave", "check_in", "complex_road")]
SAMPLES_PER_S = 2


def drive(path: Path, duration_s: int) -> tuple[RoadNetwork, Table]:
    """The map's roads, and the (T, V) vehicles that drive, twice a second."""
    if not path.is_file():
        pytest.skip("without the shared maps")
    spec = map_spec(str(path))
    scenario = Scenario.model_validate(
        {
            "scenes": [{"map": str(path), "train": 1}],
            "seed": 1,
            "rig": Rig(sensors=()),
            "time": {"tick_s": 0.1, "warm_up_s": 2, "duration_s": duration_s},
            "ego": {"reckless_probability": 0},
            "traffic": {"vehicles": 60, "pedestrians": 60, "spawn_radius_m": 500, "reckless_probability": 0},
        }
    )
    network = load_network(spec)
    scene = draw_scene(scenario, PlannedScene(0, spec, "train"), network)
    with Simulation(scene, network) as simulation:
        states = [simulation.step() for _ in range(scene.warm_up_ticks + scene.ticks)]
    rows = of_kind(np.stack([state.actors for state in states[scene.warm_up_ticks :: 10 // SAMPLES_PER_S]]), "vehicle")
    standing = [EGO_ID + index for index, vehicle in enumerate(scene.vehicles) if vehicle.stands_at is not None]
    return network, rows[:, ~np.isin(rows["id"][0], standing)]


def driven_m(rows: Table, from_s: int, to_s: int) -> Float64Array:
    """(V,) distance that each vehicle drives in a part of the scene."""
    part = rows[from_s * SAMPLES_PER_S : to_s * SAMPLES_PER_S]
    steps_m = np.hypot(np.diff(part["x"], axis=0), np.diff(part["y"], axis=0))
    return steps_m.sum(axis=0)


def walls(path: Path, network: RoadNetwork) -> tuple[shapely.STRtree, Float64Array]:
    """The plan view of the buildings' upright triangles, and the (N, 2) heights between which each stands."""
    corners_m = np.concatenate(
        [
            (tile.mesh.vertices[tile.mesh.triangles] + tile.origin_m)[
                tile.mesh.tag[tile.mesh.triangles[:, 0]] == Tag.BUILDING
            ]
            for tile in load_static_scene(map_spec(str(path)), network).tiles
        ]
    )
    heights_m = np.stack([corners_m[..., 2].min(axis=1), corners_m[..., 2].max(axis=1)], axis=1)
    is_upright = np.ptp(heights_m, axis=1) > 1.0
    lines = shapely.linestrings(corners_m[is_upright][:, [0, 1, 2, 0], :2])
    return shapely.STRtree(lines), heights_m[is_upright]


def footprints(rows: Table) -> np.ndarray:
    """The vehicles' rectangles in plan view."""
    ahead = np.stack([np.cos(rows["yaw"]), np.sin(rows["yaw"])], axis=-1).astype(np.float64)
    center_m = np.stack([rows["x"], rows["y"]], axis=-1).astype(np.float64)
    corners_m = [
        center_m + along * rows["length"][:, None] / 2.0 * ahead + aside * rows["width"][:, None] / 2.0 * left_of(ahead)
        for along, aside in ((1, 1), (1, -1), (-1, -1), (-1, 1))
    ]
    return shapely.polygons(np.stack(corners_m, axis=1))


def assert_no_vehicle_is_in_a_wall(path: Path, network: RoadNetwork, rows: Table) -> None:
    tree, heights_m = walls(path, network)
    some = rows[::2].ravel()
    vehicle, wall = tree.query(footprints(some), predicate="intersects")
    low_m, high_m = some["z"][vehicle] + 0.5, some["z"][vehicle] + 1.0
    assert not np.any((heights_m[wall, 0] < high_m) & (heights_m[wall, 1] > low_m))


@pytest.mark.slow
@pytest.mark.parametrize("path", CITIES, ids=lambda path: f"{path.parent.name}-{path.name}")
def test_in_a_city_nearly_all_vehicles_still_move_in_the_fourth_minute(path: Path) -> None:
    """The end is longer than the red lights of these maps, up to 66 s."""
    network, rows = drive(path, 240)
    assert rows.shape[1] >= 7
    assert np.mean(driven_m(rows, 0, 60) > 3.0) >= 0.9
    assert np.mean(driven_m(rows, 160, 240) > 2.0) >= 0.9
    assert_no_vehicle_is_in_a_wall(path, network, rows)


@pytest.mark.slow
@pytest.mark.parametrize("path", OPEN_ENDS, ids=lambda path: path.name)
def test_where_all_roads_lead_out_of_the_map_nearly_all_vehicles_move_in_the_first_minute(path: Path) -> None:
    network, rows = drive(path, 60)
    assert np.mean(driven_m(rows, 0, 60) > 3.0) >= 0.9
    assert_no_vehicle_is_in_a_wall(path, network, rows)
