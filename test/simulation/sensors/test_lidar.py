import numpy as np
import pytest
from point_distance import xyz
from synthetic_world import EGO_ID, actor, box, box_model, cart_model, mesh, sheet, static_scene, world

from simbev_ros.assets.materials import Material, load_materials
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.placement.static_scene import StaticScene
from simbev_ros.config.lidar import Lidar
from simbev_ros.config.sensor import Pose
from simbev_ros.foundation.geometry.transforms import apply, inverse
from simbev_ros.foundation.semantics import Tag
from simbev_ros.schema.points import POINT_DTYPE, SEMANTIC_POINT_DTYPE
from simbev_ros.schema.scene.state import WorldState, map_from_actors
from simbev_ros.simulation.raycast.scene import RayScene
from simbev_ros.simulation.sensors.lidar import LidarModel, LidarScan
from simbev_ros.simulation.sensors.mount import map_from_sensor

MODELS = (cart_model(), box_model(Tag.RIDER, (0.5, 0.5, 3.0), Material.CLOTH))
GROUND = mesh(sheet([-300, -300], [300, 300]), Tag.ROAD, Material.ASPHALT)
TURN_S = 0.05


def lidar(**properties: object) -> Lidar:
    defaults: dict[str, object] = {"channels": 16, "columns": 360, "lower_fov_deg": -30.0, "upper_fov_deg": 15.0}
    return Lidar.model_validate({"type": "lidar", "name": "top", "pose": Pose(z_m=2.0)} | defaults | properties)


def scan(sensor: Lidar, static: StaticScene, state: WorldState, seed: int = 5) -> LidarScan:
    scene = RayScene(static, MODELS)
    ego_m = np.array([state.ego["x"], state.ego["y"], state.ego["z"]])
    scene.update(state, ego_m, sensor.range_m + 10.0, frozenset() if sensor.hits_own_vehicle else state.ego_ids)
    return LidarModel(sensor, seed, TURN_S).scan(scene, state)


def test_point_dtypes_have_the_offsets_that_consumers_expect() -> None:
    fields, semantic_fields = POINT_DTYPE.fields, SEMANTIC_POINT_DTYPE.fields
    assert fields is not None
    assert semantic_fields is not None
    assert [(name, field[1]) for name, field in fields.items()] == [
        ("x", 0), ("y", 4), ("z", 8), ("intensity", 12), ("ring", 16), ("time", 18)
    ]  # fmt: skip
    assert POINT_DTYPE.itemsize == 22
    assert [(name, field[1]) for name, field in semantic_fields.items()] == [
        ("x", 0), ("y", 4), ("z", 8), ("cos_angle", 12), ("object_id", 16), ("tag", 20), ("time", 24)
    ]  # fmt: skip
    assert SEMANTIC_POINT_DTYPE.itemsize == 28


def test_rings_on_level_ground_have_the_analytic_range() -> None:
    sensor = lidar(drop_off=0.0, range_noise_sigma_m=0.0)
    cloud = scan(sensor, static_scene(GROUND), world(actor(MODELS[0], x=20.0, y=-8.0, yaw=2.0))).points
    range_m = np.linalg.norm(xyz(cloud), axis=1)
    for ring, elevation in enumerate(np.radians(np.linspace(-30.0, 15.0, 16))):
        expected_m = -2.0 / np.sin(elevation) if elevation < 0 else np.inf
        here = cloud["ring"] == ring
        assert here.sum() == (360 if expected_m <= 120.0 else 0)
        assert range_m[here] == pytest.approx(np.full(here.sum(), expected_m), rel=1e-5)


def test_a_turn_runs_clockwise_from_behind_and_ends_at_the_stamp() -> None:
    sensor = lidar(channels=2, columns=8, lower_fov_deg=-20.0, upper_fov_deg=-10.0, drop_off=0.0)
    cloud = scan(sensor, static_scene(GROUND), world(actor(MODELS[0], yaw=0.3))).points
    azimuth_deg = np.degrees(np.arctan2(cloud["y"], cloud["x"]))
    assert azimuth_deg == pytest.approx(np.repeat([157.5, 112.5, 67.5, 22.5, -22.5, -67.5, -112.5, -157.5], 2))
    assert list(cloud["ring"]) == [0, 1] * 8
    assert not cloud["time"].any(), "all rays are cast at the stamp"


def test_points_are_in_the_frame_of_the_mounted_sensor() -> None:
    wall = mesh(box([10.0, 3.0, 2.0], [2.0, 2.0, 8.0]), Tag.WALL)
    mount = Pose(x_m=1.0, y_m=0.5, z_m=2.0, yaw_deg=90.0)
    cloud = scan(lidar(pose=mount), static_scene(wall), world(actor(MODELS[0], x=5.0))).semantic_points
    # The wall's near face is 3 m ahead of the sensor, and the sensor looks left: ahead is its -y.
    assert cloud["y"].max() == pytest.approx(-3.0, abs=1e-4)
    assert cloud["x"].min() > 1.5 - 1e-3
    assert cloud["x"].max() < 3.5 + 1e-3
    assert set(cloud["tag"]) == {Tag.WALL}


def test_semantic_points_lie_in_the_box_of_their_actor() -> None:
    rng = np.random.default_rng(0)
    rows = [actor(MODELS[0])]
    for index in range(6):
        angle = index + rng.uniform(0, 0.4)
        pose = dict(zip(("yaw", "steer"), rng.uniform(-0.3, 0.3, 2), strict=True))
        rows.append(actor(MODELS[0], id=20 + index, x=12 * np.cos(angle), y=12 * np.sin(angle), **pose))
    state, sensor = world(*rows), lidar(columns=720)
    cloud = scan(sensor, static_scene(GROUND), state).semantic_points
    points_map = apply(map_from_sensor(sensor.pose, state), xyz(cloud))
    assert set(cloud["tag"][cloud["object_id"] == 0]) == {Tag.ROAD}
    for row, actor_from_map in zip(state.actors[1:], inverse(map_from_actors(state.actors[1:])), strict=True):
        points_m = apply(actor_from_map, points_map[cloud["object_id"] == row["id"]])
        assert len(points_m) > 30
        half_m = np.array([row["length"], row["width"] + 0.2, row["height"]]) / 2  # steered wheels stick out
        assert (np.abs(points_m - [0, 0, half_m[2]]) <= half_m + 1e-3).all()


def test_lidar_sees_neither_its_vehicle_nor_the_rider_on_it() -> None:
    rider = actor(MODELS[1], 1, id=8, parent=EGO_ID, x=-1.0)
    other = actor(MODELS[1], 1, id=9, x=-6.0)
    cloud = scan(lidar(), static_scene(GROUND), world(actor(MODELS[0]), rider, other)).semantic_points
    assert set(cloud["object_id"]) == {0, 9}


def test_noise_is_along_the_ray_with_the_configured_sigma() -> None:
    sensor = lidar(channels=64, columns=1024, upper_fov_deg=-5.0, range_noise_sigma_m=0.05, drop_off=0.0)
    found = scan(sensor, static_scene(GROUND), world(actor(MODELS[0])))
    truth, noisy = xyz(found.semantic_points), xyz(found.points)
    range_m = np.linalg.norm(truth, axis=1)
    error_m = np.linalg.norm(noisy, axis=1) - range_m
    assert len(error_m) == 65536
    assert error_m.mean() == pytest.approx(0.0, abs=1e-3)
    assert error_m.std() == pytest.approx(0.05, rel=0.02)
    assert np.abs(np.linalg.norm(np.cross(truth, noisy), axis=1) / range_m).max() < 1e-5


def test_the_configured_share_of_returns_is_lost() -> None:
    sensor = lidar(channels=64, columns=1024, upper_fov_deg=-5.0, drop_off=0.14)
    found = scan(sensor, static_scene(GROUND), world(actor(MODELS[0])))
    assert len(found.semantic_points) == 65536
    assert len(found.points) / 65536 == pytest.approx(0.86, abs=0.005)
    everything_lost = scan(lidar(drop_off=1.0), static_scene(GROUND), world(actor(MODELS[0])))
    assert len(everything_lost.points) == 0


def test_noise_repeats_for_a_tick_and_every_ray_has_its_own() -> None:
    static, ego = static_scene(GROUND), actor(MODELS[0])
    first = scan(lidar(), static, world(ego, tick=3)).points
    again = scan(lidar(), static, world(ego, tick=3)).points
    later = scan(lidar(), static, world(ego, tick=4)).points
    assert first.tobytes() == again.tobytes()
    assert first.tobytes() != later.tobytes()
    obstructed = scan(lidar(), static, world(ego, actor(MODELS[0], id=9, x=9.0), tick=3)).points
    shared = np.isin(obstructed, first).sum()
    assert 0.9 * len(first) < shared < len(first)


def test_intensity_is_reflectance_times_cosine_times_attenuation() -> None:
    wall = Mesh.merge([mesh(box([21.0, 0.0, 2.0], [2.0, 200.0, 100.0]), Tag.WALL, Material.PLASTER)])
    sensor = lidar(channels=1, columns=3600, lower_fov_deg=0.0, upper_fov_deg=0.0, drop_off=0.0)
    found = scan(sensor, static_scene(wall), world(actor(MODELS[0])))
    semantic = found.semantic_points
    range_m = np.linalg.norm(xyz(semantic), axis=1)
    assert semantic["cos_angle"] == pytest.approx(20.0 / range_m, abs=1e-5)
    reflectance = load_materials().lidar_reflectance[Material.PLASTER]
    expected = reflectance * 20.0 / range_m * np.exp(-0.004 * range_m)
    assert found.points["intensity"] == pytest.approx(expected, rel=1e-4)


def test_retroreflective_plates_are_bright_from_all_angles_and_markings_at_grazing_rays() -> None:
    plate = mesh(box([21.0, 0.0, 2.0], [2.0, 120.0, 100.0]), Tag.TRAFFIC_SIGN, Material.PLATE)
    sensor = lidar(channels=1, columns=3600, lower_fov_deg=0.0, upper_fov_deg=0.0, drop_off=0.0, attenuation_per_m=0.0)
    cloud = scan(sensor, static_scene(plate), world(actor(MODELS[0]))).points
    assert cloud["intensity"] == pytest.approx(np.ones(len(cloud)))
    painted = mesh(sheet([-300, -300], [300, 300]), Tag.ROAD_LINE, Material.MARKING)
    flat = lidar(channels=1, lower_fov_deg=-1.5, upper_fov_deg=-1.5, drop_off=0.0, attenuation_per_m=0.0)
    cloud = scan(flat, static_scene(painted), world(actor(MODELS[0]))).points
    reflectance = load_materials().lidar_reflectance[Material.MARKING]
    assert cloud["intensity"] == pytest.approx(
        np.full(360, np.pi * 0.15 + reflectance * np.sin(np.radians(1.5))), abs=2e-3
    )


def test_weak_returns_are_lost_with_a_probability_that_depends_on_intensity() -> None:
    limits = {"drop_off_at_zero_intensity": 0.4, "drop_off_intensity_limit": 0.2, "attenuation_per_m": 0.0}
    sensor = lidar(channels=64, columns=2048, lower_fov_deg=-60.0, upper_fov_deg=-2.0, drop_off=0.0, **limits)
    found = scan(sensor, static_scene(GROUND), world(actor(MODELS[0])))
    sines = np.sin(np.radians(-np.linspace(-60.0, -2.0, 64)))
    share = 0.4 * (1.0 - np.minimum(0.17 * sines, 0.2) / 0.2)
    assert len(found.semantic_points) == 64 * 2048
    lost = 1.0 - np.bincount(found.points["ring"], minlength=64) / 2048
    assert lost == pytest.approx(share, abs=0.045)
    assert lost.mean() == pytest.approx(share.mean(), abs=0.004)


def test_returns_nearer_than_the_minimum_range_are_missing() -> None:
    cloud = scan(lidar(min_range_m=5.0), static_scene(GROUND), world(actor(MODELS[0]))).semantic_points
    assert np.linalg.norm(xyz(cloud), axis=1).min() >= 5.0


def test_the_lidars_own_vehicle_is_hit_only_if_configured() -> None:
    rider = actor(MODELS[1], 1, id=8, parent=EGO_ID, x=-1.0)
    cloud = scan(lidar(hits_own_vehicle=True), static_scene(GROUND), world(actor(MODELS[0]), rider)).semantic_points
    assert set(cloud["object_id"]) == {0, EGO_ID, 8}


def test_two_lidars_share_a_scene_and_neither_changes_the_other() -> None:
    state = world(actor(MODELS[0], yaw=0.5), actor(MODELS[0], id=9, x=8.0, yaw=0.2), actor(MODELS[0], id=10, x=-9.0))
    roof, bumper = lidar(), lidar(name="bumper", pose=Pose(x_m=2.2, z_m=0.6, pitch_deg=5.0), range_m=30.0)
    scene = RayScene(static_scene(GROUND), MODELS)
    scene.update(state, np.zeros(3), 130.0, state.ego_ids)
    together = [LidarModel(sensor, 5, TURN_S).scan(scene, state) for sensor in (roof, bumper)]
    for sensor, found in zip((roof, bumper), together, strict=True):
        alone = scan(sensor, static_scene(GROUND), state)
        assert found.points.tobytes() == alone.points.tobytes()
        assert found.semantic_points.tobytes() == alone.semantic_points.tobytes()


def test_a_cloud_that_is_not_published_is_not_computed() -> None:
    found = scan(lidar(semantic_points=False), static_scene(GROUND), world(actor(MODELS[0])))
    assert found.semantic_points is None
    assert len(found.points)
