"""In a real town, every noise-free point lies on the mesh of its object id, and noise and loss are as configured."""

from functools import cache

import numpy as np
import pytest
from point_distance import distances_m, xyz
from rclpy.serialization import serialize_message
from rosbags.typesys import Stores, get_typestore

from simbev_ros.assets.actors.catalog import load_models
from simbev_ros.assets.actors.posing import pose_actors
from simbev_ros.assets.placement.static_scene import StaticScene
from simbev_ros.assets.regions.static_cache import load_static_scene
from simbev_ros.config.lidar import Lidar
from simbev_ros.config.load import load_scenario
from simbev_ros.config.traffic import Traffic
from simbev_ros.foundation.geometry.transforms import apply
from simbev_ros.maps.build import load_network
from simbev_ros.ros.msgs.tables import message_from_table
from simbev_ros.scene.drawing.draw_scene import draw_scene, planned_scenes
from simbev_ros.schema.points import POINT_DTYPE, SEMANTIC_POINT_DTYPE
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.simulation.raycast.scene import RayScene
from simbev_ros.simulation.sensors.lidar import LidarModel, LidarScan
from simbev_ros.simulation.sensors.mount import map_from_sensor
from simbev_ros.simulation.world.simulation import Simulation

TYPES = get_typestore(Stores.ROS2_JAZZY)
STAMP_NS = 3_600_123_456_789


@cache
def static_scene_and_state() -> tuple[StaticScene, WorldState]:
    scenario = load_scenario("demo").model_copy(
        update={"seed": 92, "traffic": Traffic(vehicles=36, pedestrians=60, spawn_radius_m=100)}
    )
    planned = next(planned_scenes(scenario))
    network = load_network(planned.map)
    with Simulation(draw_scene(scenario, planned, network), network) as simulation:
        states = [simulation.step() for _ in range(30)]
    return load_static_scene(planned.map, network), states[-1]


def scan(sensor: Lidar) -> LidarScan:
    static, state = static_scene_and_state()
    scene = RayScene(static, load_models())
    ego_m = np.array([state.ego["x"], state.ego["y"], state.ego["z"]])
    scene.update(state, ego_m, sensor.range_m + 5.0, state.ego_ids)
    return LidarModel(sensor, 1, 0.05).scan(scene, state)


def lidar(**properties: object) -> Lidar:
    mount = {"x_m": 0.2, "z_m": 1.8, "roll_deg": 1.0, "pitch_deg": -2.0, "yaw_deg": 30.0}
    return Lidar.model_validate({"type": "lidar", "name": "top", "pose": mount, "weather_effects": False} | properties)


def test_every_point_lies_on_the_mesh_of_its_object_within_a_millimeter() -> None:
    static, state = static_scene_and_state()
    sensor = lidar(channels=64, columns=1024)
    cloud = scan(sensor).semantic_points
    assert cloud is not None
    points = apply(map_from_sensor(sensor.pose, state), xyz(cloud))
    models, rng = load_models(), np.random.default_rng(0)
    ids = np.unique(cloud["object_id"])
    assert len(ids) > 15
    for number in ids[ids > 0]:
        row = state.actors[state.actors["id"] == number]
        here = np.flatnonzero(cloud["object_id"] == number)
        here = rng.choice(here, min(len(here), 25), replace=False)
        origin_m = np.array([row["x"][0], row["y"][0], row["z"][0]])
        posed = pose_actors(models, row, origin_m)
        corners = posed.vertices.astype(np.float64)[posed.triangles]
        assert distances_m(points[here] - origin_m, corners).max() < 1e-3
        assert set(cloud["tag"][here]) == {int(row["tag"][0])}
    chosen = rng.choice(np.flatnonzero(cloud["object_id"] == 0), 300, replace=False)
    nearest_m = np.full(len(chosen), np.inf)
    for tile in static.tiles:
        low, high = (tile.mesh.bounds_m + tile.origin_m)[:, :2] + [[-0.1], [0.1]]
        position_m = points[chosen, :2]
        here = np.flatnonzero(((position_m > low) & (position_m < high)).all(axis=1))
        corners = tile.mesh.vertices[tile.mesh.triangles].astype(np.float64)
        for tag in np.unique(cloud["tag"][chosen[here]]):
            of_tag = here[cloud["tag"][chosen[here]] == tag]
            found_m = distances_m(points[chosen[of_tag]] - tile.origin_m, corners[tile.mesh.triangle_tag == tag])
            nearest_m[of_tag] = np.minimum(nearest_m[of_tag], found_m)
    assert nearest_m.max() < 1e-3


def test_noise_and_loss_are_as_configured() -> None:
    whole = lidar(drop_off=0.0, range_noise_sigma_m=0.02)
    found = scan(whole)
    assert found.points is not None
    assert found.semantic_points is not None
    truth_m, noisy_m = (np.linalg.norm(xyz(cloud), axis=1) for cloud in (found.semantic_points, found.points))
    assert len(truth_m) > 200_000
    assert (noisy_m - truth_m).std() == pytest.approx(0.02, rel=0.03)
    assert (noisy_m - truth_m).mean() == pytest.approx(0.0, abs=2e-4)
    points = scan(lidar()).points
    assert points is not None
    assert len(points) / len(truth_m) == pytest.approx(0.86, abs=0.005)


@pytest.mark.parametrize(("dtype", "cloud"), [(POINT_DTYPE, "points"), (SEMANTIC_POINT_DTYPE, "semantic_points")])
def test_another_library_reads_the_same_columns(dtype: np.dtype, cloud: str) -> None:
    table = getattr(scan(lidar(channels=16, columns=256)), cloud)
    data = bytes(serialize_message(message_from_table(table, STAMP_NS, "ego/lidar")))
    message = TYPES.deserialize_cdr(data, "sensor_msgs/msg/PointCloud2")
    sizes = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 8: 8}  # PointField's data types
    codes = {4: "<u2", 6: "<u4", 7: "<f4"}
    assert [field.name for field in message.fields] == list(dtype.names)
    ends = [field.offset + sizes[field.datatype] * field.count for field in message.fields]
    assert all(end <= start.offset for end, start in zip(ends, message.fields[1:], strict=False))
    assert ends[-1] == message.point_step
    assert message.row_step == message.point_step * message.width == len(message.data)
    for field in message.fields:
        column = np.ndarray(
            message.width, codes[field.datatype], message.data.data, field.offset, (message.point_step,)
        )
        assert np.array_equal(column, table[field.name])
