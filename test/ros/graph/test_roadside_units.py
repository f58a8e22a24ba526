"""Two cars and two roadside units in one recorded scene: a mast at a junction, and a camera above the road."""

import numpy as np
import pytest
from commands import SCENE, Command

from simbev_ros.dataset import open_dataset
from simbev_ros.dataset.scene import Scene
from simbev_ros.foundation.geometry.transforms import apply, inverse
from simbev_ros.foundation.semantics import Tag
from simbev_ros.recording.verify import verify_bag
from simbev_ros.schema.scene.state import map_from_actors

pytestmark = [pytest.mark.graph, pytest.mark.slow]

SCENES = """
seed: 11
scenes: [{map: Blocks, train: 1}]
time: {warm_up_s: 1, duration_s: 0.5}
weather: {cloudiness: 20, precipitation: 0, sun_altitude_deg: 45, fog_density: 0}
traffic: {vehicles: 15, pedestrians: 15, spawn_radius_m: 150}
annotation:
  bev: {rows: 100, columns: 100}
agents:
  - {name: ego, rig: {sensors: [{type: lidar, name: lidar, pose: {z_m: 2}, channels: 8, columns: 128}]}}
  - {name: van, rig: {sensors: [{type: imu, name: imu}]}, blueprint: vehicle.van, near: {distance_m: 25}}
  - name: rsu
    mast: {junction: {near: {distance_m: 60, tolerance_m: 60}}, height_m: 5}
    rig:
      sensors:
        - {type: camera, name: cam, pose: {pitch_deg: 20}, width_px: 96, height_px: 64, modalities: [rgb, depth]}
        - {type: lidar, name: lidar, pose: {z_m: 1}, channels: 16, columns: 256, semantic_points: true}
        - {type: radar, name: radar, pose: {pitch_deg: 10}, points_per_second: 4000}
        - {type: gnss, name: gnss}
        - {type: imu, name: imu}
  - name: eye
    mast: {above_road: {near: {distance_m: 8, tolerance_m: 8}}, height_m: 30}
    rig:
      sensors:
        - {type: camera, name: cam, pose: {pitch_deg: 90}, width_px: 240, height_px: 240, horizontal_fov_deg: 90,
           modalities: [rgb, instance]}
"""


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    folder = tmp_path_factory.mktemp("units")
    (folder / "units.yaml").write_text(SCENES, encoding="utf-8")
    code, output = Command("run", folder / "units.yaml", "--record", folder / "out", cores=2).finish(300)
    assert code == 0, output
    bag = folder / "out" / SCENE
    assert verify_bag(bag) == []
    return open_dataset(bag, threads=1).scenes[0]


def test_units_stand_still_and_all_their_sensors_are_recorded(scene: Scene) -> None:
    assert scene.agents == ("ego", "van", "rsu", "eye")
    unit = scene.of_agent("rsu")
    for tick in (0, 9):
        frame = unit[tick]
        pose = map_from_actors(unit.view.ego_row(frame["world/actors"]).reshape(1))[0]
        np.testing.assert_allclose(frame.map_from_ego, pose, atol=1e-6)
        np.testing.assert_allclose(frame["imu/data"]["acceleration_mps2"], [[0.0, 0.0, 9.81]], atol=0.05)
        assert abs(frame["imu/data"]["angular_velocity_radps"]).max() < 0.01
        assert {"cam/rgb", "cam/depth", "radar/points", "gnss/fix", "bev/labels", "boxes", "hd_map"} <= set(frame)


def test_cars_are_in_the_boxes_of_units_by_their_distance_from_the_mast(scene: Scene) -> None:
    for name in ("rsu", "eye"):
        unit = scene.of_agent(name)
        boxes, actors = unit[9]["boxes"], unit[9]["world/actors"]
        foot_m = unit[9].map_from_ego[:2, 3]
        for other in ("ego", "van"):
            other_id = scene.of_agent(other).view.ego_id
            (row,) = actors[actors["id"] == other_id]
            (box,) = boxes[boxes["id"] == other_id]
            assert box["distance"] == pytest.approx(np.hypot(row["x"] - foot_m[0], row["y"] - foot_m[1]), abs=0.05)


def test_points_of_a_mast_are_on_the_ground_and_on_the_vehicles_that_they_name(scene: Scene) -> None:
    on_vehicles = 0
    for tick in range(10):
        frame = scene.of_agent("rsu")[tick]
        points = frame["lidar/semantic_points"]
        points_map = apply(frame.map_from_sensor("lidar"), np.stack([points[name] for name in "xyz"], axis=1))
        on_road_m = points_map[points["tag"] == Tag.ROAD, 2]
        assert len(on_road_m) > 200 and np.abs(on_road_m - frame.map_from_ego[2, 3]).max() < 1.0
        for row in frame["world/actors"]:
            own_map = points_map[points["object_id"] == row["id"]]
            own = np.abs(apply(inverse(map_from_actors(row.reshape(1))[0]), own_map))
            assert np.all(own <= [0.5 * row["length"] + 0.3, 0.5 * row["width"] + 0.3, row["height"] + 0.1])
            on_vehicles += len(own) if row["length"] > 3.0 else 0
    assert on_vehicles > 10


def test_the_camera_above_the_road_sees_the_vehicles_below_it(scene: Scene) -> None:
    unit = scene.of_agent("eye")
    frame = unit[9]
    actors = frame["world/actors"]
    centers_m = (inverse(frame.map_from_ego) @ map_from_actors(actors))[:, :2, 3]
    below = actors["id"][(np.abs(centers_m) < 26.0).all(axis=1) & (actors["length"] > 3.0)]
    seen = np.unique(frame["cam/instance"])
    assert scene.view.ego_id in below and scene.view.ego_id in seen
    assert np.isin(below, seen).mean() > 0.5, "trees hide some vehicles, but not most"
