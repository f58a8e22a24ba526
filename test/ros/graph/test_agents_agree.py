"""Three cars and roadside units in Town05: one world, whichever of them looks at it."""

from itertools import combinations
from typing import Any

import numpy as np
import pytest
from commands import Command

from simbev_ros.assets.actors.catalog import load_models
from simbev_ros.assets.regions.static_cache import load_static_scene
from simbev_ros.dataset import open_dataset
from simbev_ros.dataset.frame import Frame
from simbev_ros.dataset.scene import Scene
from simbev_ros.foundation.geometry.transforms import matrices_from_xyz_quaternion
from simbev_ros.foundation.semantics import BEV_CLASSES
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.build import load_network
from simbev_ros.recording.reader import SceneBag
from simbev_ros.recording.verify import verify_bag
from simbev_ros.scene.reach import loaded_reach
from simbev_ros.schema.boxes import BOX_DTYPE
from simbev_ros.schema.scene.state import EGO_ID, WorldState
from simbev_ros.simulation.raycast.merged import MergedScene

pytestmark = [pytest.mark.graph, pytest.mark.slow]

CONFIG = """
seed: 12
scenes: [{map: Town05, train: 1}]
time: {warm_up_s: 1, duration_s: 0.5}
agents:
  - {name: ego, rig: car.yaml}
  - {name: car_1, rig: car.yaml, blueprint: vehicle.van, near: {distance_m: 15, tolerance_m: 10}}
  - {name: car_2, rig: car.yaml, blueprint: vehicle.box_truck, near: {distance_m: 25, tolerance_m: 15}}
  - {name: rsu, rig: mast.yaml, mast: {junction: {near: {distance_m: 60, tolerance_m: 60}}, height_m: 8}}
  - {name: south, rig: {sensors: []}, mast: {poses: [{x_m: -13.5, y_m: -10}]}}
  - {name: north, rig: {sensors: []}, mast: {poses: [{x_m: -13.5, y_m: 6}]}}
weather: {cloudiness: 20, precipitation: 0, sun_altitude_deg: 45, fog_density: 0}
traffic: {vehicles: 30, pedestrians: 30, spawn_radius_m: 120}
annotation: {bev: {rows: 200, columns: 200}}
"""
LIDAR = "{type: lidar, name: lidar, pose: {z_m: HEIGHT}, channels: 32, columns: 512, range_noise_sigma_m: 0}"
CAMERA = "{type: camera, name: cam, pose: {z_m: HEIGHT}, width_px: 160, height_px: 96}"
RIG = f"sensors:\n  - {LIDAR}\n  - {CAMERA}\n"
CARS, LOOKING = ("ego", "car_1", "car_2"), ("ego", "car_1", "car_2", "rsu")
TICKS = (0, 5, 9)
OBSERVER = ("distance", "angle", "on_ego_level", "difficulty", "valid", "visibility", "lidar_points", "radar_points")


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    folder = tmp_path_factory.mktemp("town")
    (folder / "agents.yaml").write_text(CONFIG, encoding="utf-8")
    (folder / "car.yaml").write_text(RIG.replace("HEIGHT", "3.9"), encoding="utf-8")
    (folder / "mast.yaml").write_text(RIG.replace("HEIGHT", "1"), encoding="utf-8")
    code, output = Command("run", folder / "agents.yaml", "--record", folder / "out").finish(600)
    assert code == 0, output
    assert verify_bag(folder / "out" / "scenes/train/Town05-0000") == []
    return open_dataset(folder / "out", threads=1).scenes[0]


@pytest.fixture(scope="module")
def transforms(scene: Scene) -> dict[int, dict[str, Float64Array]]:
    """Per tick, the (4, 4) poses of all frames in the map, from the bag's ``/tf`` and ``/tf_static``."""
    with SceneBag(scene.path) as bag:
        stamps = {stamp: tick for tick, stamp in enumerate(scene.stamps_ns.tolist())}
        messages = [bag.decode(message) for message in bag.messages(["/tf", "/tf_static"])]
    fixed = {each.child_frame_id: each for message in messages for each in message.transforms if not _is_root(each)}
    poses: dict[int, dict[str, Float64Array]] = {}
    for message in messages:
        for each in filter(_is_root, message.transforms):
            tick = stamps[each.header.stamp.sec * 10**9 + each.header.stamp.nanosec]
            poses.setdefault(tick, {})[each.child_frame_id] = _matrix(each)
    for of_tick in poses.values():
        while missing := [name for name in fixed if name not in of_tick]:
            for name in missing:
                if fixed[name].header.frame_id in of_tick:
                    of_tick[name] = of_tick[fixed[name].header.frame_id] @ _matrix(fixed[name])
    return poses


def _is_root(transform: Any) -> bool:
    return bool(transform.header.frame_id == "map")


def _matrix(transform: Any) -> Float64Array:
    xyz, q = transform.transform.translation, transform.transform.rotation
    return matrices_from_xyz_quaternion(np.array([xyz.x, xyz.y, xyz.z]), np.array([q.x, q.y, q.z, q.w]))


def of_all_agents(scene: Scene, tick: int) -> dict[str, Frame]:
    return {name: scene.of_agent(name)[tick] for name in scene.agents}


def test_all_have_the_same_stamps(scene: Scene) -> None:
    with SceneBag(scene.path) as bag:
        stamps: dict[str, list[int]] = {}
        for message in bag.messages(None):
            stamps.setdefault(message.topic, []).append(message.stamp_ns)
    clock = stamps["/clock"]
    for name in scene.agents:
        for topic in ("odom", "boxes", "bev/labels"):
            assert stamps[f"/{name}/{topic}"] == clock, (name, topic)
    of_sensors = [topic for topic in stamps if "/lidar/" in topic or "/cam/" in topic]
    assert len(of_sensors) > 20
    assert all(stamps[topic] == clock for topic in of_sensors)


def test_every_actor_is_the_same_to_the_bit_in_the_tables_of_all(scene: Scene) -> None:
    compared = 0
    shared = [name for name in BOX_DTYPE.names or () if name not in OBSERVER]
    for tick in range(len(scene)):
        tables = [frame["boxes"] for frame in of_all_agents(scene, tick).values()]
        for one, other in combinations(tables, 2):
            _, rows, others = np.intersect1d(one["id"], other["id"], return_indices=True)
            for name in shared:
                assert one[name][rows].tobytes() == other[name][others].tobytes(), name
            compared += len(rows)
    assert compared > 100


def test_each_car_is_where_its_actor_is_and_in_the_tables_of_the_others(scene: Scene) -> None:
    for tick in range(len(scene)):
        frames, actors = of_all_agents(scene, tick), scene[tick]["world/actors"]
        carriers = {name: frame.scene.view.ego_id for name, frame in frames.items()}
        for name, frame in frames.items():
            others = {carriers[car] for car in CARS if car != name}
            assert others <= set(frame["boxes"]["id"].tolist()) and carriers[name] not in frame["boxes"]["id"]
            for row in actors[actors["id"] == carriers[name]]:
                assert frame.map_from_ego[:3, 3].tolist() == [row["x"], row["y"], row["z"]]


@pytest.mark.parametrize("tick", TICKS)
def test_points_of_one_lie_on_the_mesh_that_all_see(
    scene: Scene, transforms: dict[int, dict[str, Float64Array]], tick: int
) -> None:
    """Embree, with all triangles in one mesh: rays from each lidar along its points, placed by /tf."""
    whole, ids = scene.spec, {name: scene.of_agent(name).view.ego_id for name in scene.agents}
    network = load_network(whole.map)
    static, models = load_static_scene(whole.map, network, reach=loaded_reach(whole, network)), load_models()
    on_others = 0
    for name in LOOKING:
        frame = scene.of_agent(name)[tick]
        pose, points = transforms[tick][f"{name}/lidar"], frame["lidar/points"]
        xyz_m = np.stack([points[axis] for axis in "xyz"], axis=1).astype(np.float64)
        range_m = np.linalg.norm(xyz_m, axis=1)
        actors = frame["world/actors"]
        mesh = MergedScene(static, models, pose[:3, 3], 130.0)
        own = {ids[name], *actors["id"][actors["parent"] == ids[name]].tolist()}
        mesh.build(WorldState(frame.stamp_ns, tick, EGO_ID, actors, frame["world/signals"], whole.weather), own)
        directions = (xyz_m / range_m[:, None]) @ pose[:3, :3].T
        hit_m = mesh.ranges_m(pose[:3, 3], directions.astype(np.float32))
        assert len(points) > 2000 and (np.abs(hit_m - range_m) < 0.002).mean() > 0.999
        hit_ids = frame["lidar/semantic_points"]["object_id"]
        on_others += int(np.isin(hit_ids, [carrier for other, carrier in ids.items() if other != name]).sum())
    assert on_others > 20


def test_aligned_grids_are_equal_cell_by_cell(scene: Scene) -> None:
    """Two roadside units without sensors, one 40 cells to the left of the other."""
    found = 0
    for tick in TICKS:
        south, north = (scene.of_agent(name)[tick]["bev/labels"] for name in ("south", "north"))
        assert (south[:, :-40] == north[:, 40:]).all()
        found |= int(np.bitwise_or.reduce(south[:, :-40], axis=None))
    names = {name for index, name in enumerate(BEV_CLASSES) if found >> index & 1}
    assert {"road", "sidewalk", "crosswalk", "car"} <= names


def test_what_anybody_sees_is_in_the_joint_truth(scene: Scene) -> None:
    for tick in TICKS:
        joint, frames = scene[tick]["world/boxes"], of_all_agents(scene, tick)
        assert joint["id"].tolist() == sorted(
            {row for frame in frames.values() for row in frame["boxes"]["id"].tolist()}
        )
        for bit, (name, frame) in enumerate(frames.items()):
            boxes = frame["boxes"]
            seen = boxes["id"][(boxes["lidar_points"] > 0) | (boxes["radar_points"] > 0) | (boxes["visibility"] > 0)]
            assert joint["id"][joint["seen_by"] >> bit & 1 == 1].tolist() == sorted(seen.tolist()), name
        assert (joint["seen"].astype(bool) == (joint["seen_by"] != 0)).all()
