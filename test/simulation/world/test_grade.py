"""An ego that drives up a straight road of 10 % grade: its pose and motion, and its sensors."""

import subprocess
from dataclasses import replace

import numpy as np
import pytest
from scene_edits import with_ego
from synthetic_world import mesh, static_scene
from world_scenes import TICK_S, blocks, scene

from simbev_ros.assets.actors.catalog import load_models
from simbev_ros.config.camera import Camera
from simbev_ros.config.lidar import Lidar
from simbev_ros.config.positioning import Imu
from simbev_ros.config.rig import Rig
from simbev_ros.config.sensor import Pose
from simbev_ros.foundation.geometry.transforms import matrices_from_xyz_rpy
from simbev_ros.foundation.semantics import Tag
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.roads.layout import Strip
from simbev_ros.maps.roads.levels import assign_levels
from simbev_ros.maps.sumo.layout import layout_of
from simbev_ros.maps.sumo.net import read_sumo_net
from simbev_ros.maps.sumo.netconvert import sumo_home
from simbev_ros.ros.msgs.transforms import ego_transform, static_transforms
from simbev_ros.ros.msgs.world import odometry_message
from simbev_ros.scene.blueprints import blueprint_named
from simbev_ros.schema.scene.spec import SceneSpec, VehicleSpec, WaypointSpec
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.simulation.raycast.scene import RayScene
from simbev_ros.simulation.sensors.imu import ImuModel
from simbev_ros.simulation.sensors.lidar import LidarModel
from simbev_ros.simulation.sensors.mount import map_from_sensor
from simbev_ros.simulation.world.simulation import Simulation

GRADE = 0.1
NODES = '<nodes><node id="a" x="0" y="0" z="0"/><node id="b" x="800" y="0" z="80"/></nodes>'
EDGES = '<edges><edge id="up" from="a" to="b" numLanes="2" speed="14"/></edges>'
LIDAR = Lidar(type="lidar", name="lidar", pose=Pose(x_m=0.3, z_m=1.8), channels=16, columns=90, upper_fov_deg=-8.0)
CAMERA = Camera(type="camera", name="cam", pose=Pose(x_m=0.6, y_m=0.2, z_m=1.6, yaw_deg=55), modalities=("rgb",))
IMU = Imu(
    type="imu", name="imu", accelerometer_noise_sigma_mps2=0, gyroscope_noise_sigma_radps=0, gyroscope_bias_radps=0
)


@pytest.fixture(scope="module")
def road(tmp_path_factory: pytest.TempPathFactory) -> RoadNetwork:
    folder = tmp_path_factory.mktemp("grade")
    net, nodes, edges = folder / "map.net.xml", folder / "map.nod.xml", folder / "map.edg.xml"
    nodes.write_text(NODES)
    edges.write_text(EDGES)
    command = [sumo_home() / "bin" / "netconvert", "-n", nodes, "-e", edges, "-o", net]
    subprocess.run([*command, "--offset.disable-normalization"], check=True, capture_output=True)
    content = read_sumo_net(net)
    layout = assign_levels(layout_of(content))
    layout = replace(layout, strips=tuple(map(level_across, layout.strips)))
    return replace(blocks(), lanes=content.lanes, junctions={}, signals=(), layout=layout, net_path=net)


def level_across(strip: Strip) -> Strip:
    """The strip without crossfall."""
    left_m, right_m = (np.column_stack([side[:, :2], GRADE * side[:, 0]]) for side in (strip.left_m, strip.right_m))
    return replace(strip, left_m=left_m, right_m=right_m)


@pytest.fixture(scope="module")
def spec() -> SceneSpec:
    start = WaypointSpec(lane="up_0", s_m=20.0)
    ego = VehicleSpec(blueprint="vehicle.sedan", color=0, start=start, speed_factor=1.0, min_gap_m=2.0)
    rig = Rig(sensors=(LIDAR, CAMERA, IMU))
    return with_ego(scene(ticks=260).model_copy(update={"vehicles": (ego,), "pedestrians": ()}), rig=rig)


@pytest.fixture(scope="module")
def states(road: RoadNetwork, spec: SceneSpec) -> list[WorldState]:
    with Simulation(spec, road) as simulation:
        return [simulation.step() for _ in range(spec.warm_up_ticks + spec.ticks)]


def test_the_ego_stands_and_drives_on_the_slope(states: list[WorldState]) -> None:
    rows = np.array([state.ego for state in states])
    assert np.ptp(rows["x"]) > 100.0
    np.testing.assert_allclose(rows["z"], GRADE * rows["x"], atol=2e-3)
    np.testing.assert_allclose(rows["pitch"], -np.arctan(GRADE), atol=1e-4)
    np.testing.assert_allclose(rows["vz"], GRADE * rows["vx"], atol=3e-3)
    np.testing.assert_allclose(
        rows["z"][1:] - rows["z"][:-1], (rows["vz"][1:] + rows["vz"][:-1]) / 2 * TICK_S, atol=1e-3
    )
    assert np.abs(rows["wy"]).max() < 1e-3


def test_the_ego_backs_down_the_slope_and_its_sensors_agree(road: RoadNetwork, spec: SceneSpec) -> None:
    driven = with_ego(spec, driver="twist")
    with Simulation(driven, road) as simulation:
        states = []
        for tick in range(200):
            simulation.drive_vehicle(0, 4.0 if tick < 80 else -4.0, 0.0)
            states.append(simulation.step())
    rows, slant = np.array([state.ego for state in states]), np.hypot(1.0, GRADE)
    np.testing.assert_allclose(rows["pitch"], -np.arctan(GRADE), atol=1e-4)
    np.testing.assert_allclose(rows["z"], GRADE * rows["x"], atol=2e-3)
    twist = odometry_message(rows[-1], states[-1].stamp_ns, "ego/base_link").twist.twist
    assert twist.linear.x == pytest.approx(-4.0 * slant, abs=0.01) and abs(twist.linear.z) < 0.01
    speeding_up = int(np.flatnonzero(rows["vx"] < -2.0)[0])
    imu = ImuModel(IMU, 0, round(TICK_S * 1e9))
    imu.measure(states[speeding_up - 1], None)
    ahead_mps2 = imu.measure(states[speeding_up], states[speeding_up - 1]).linear_acceleration_mps2[-1, 0]
    accel_mps2 = blueprint_named("vehicle.sedan").accel
    assert ahead_mps2 == pytest.approx(9.81 * GRADE / slant - accel_mps2 * slant, abs=0.05)


def test_the_road_lies_level_below_the_lidar(states: list[WorldState], spec: SceneSpec) -> None:
    corners = np.array([[x, y, GRADE * x] for x, y in ((-500, -300), (1300, -300), (1300, 300), (-500, 300))])
    rays = RayScene(static_scene(mesh(corners[[[0, 1, 2], [0, 2, 3]]], Tag.ROAD)), load_models())
    state = states[-1]
    rays.update(state, map_from_sensor(LIDAR.pose, state)[:3, 3], LIDAR.range_m, state.ego_ids)
    points = LidarModel(LIDAR, spec.seed, TICK_S).scan(rays, state).semantic_points
    assert len(points) == LIDAR.channels * LIDAR.columns
    np.testing.assert_allclose(points["z"], -LIDAR.pose.z_m, atol=0.01)


def test_gravity_pulls_the_standing_ego_backwards(states: list[WorldState]) -> None:
    sample = ImuModel(IMU, 0, round(TICK_S * 1e9)).measure(states[0], None)
    angle_rad = np.arctan(GRADE)
    expected = 9.81 * np.array([np.sin(angle_rad), 0.0, np.cos(angle_rad)])
    np.testing.assert_allclose(sample.linear_acceleration_mps2[0], expected, atol=1e-3)


def test_frames_of_all_sensors_tilt_with_the_ego(states: list[WorldState], spec: SceneSpec) -> None:
    state = states[-1]
    odometry = odometry_message(state.ego, state.stamp_ns, "ego/base_link")
    map_from_ego = matrix(ego_transform(odometry).transform)
    mounts = {each.child_frame_id: matrix(each.transform) for each in static_transforms(spec)}
    for sensor in (LIDAR, CAMERA, IMU):
        expected = map_from_sensor(sensor.pose, state)
        np.testing.assert_allclose(map_from_ego @ mounts[f"ego/{sensor.name}"], expected, atol=1e-5)
    along = np.array([1.0, 0.0, GRADE]) / np.hypot(1.0, GRADE)
    np.testing.assert_allclose(map_from_sensor(LIDAR.pose, state)[:3, 0], along, atol=1e-4)
    yaw_rad = np.radians(CAMERA.pose.yaw_deg)
    looks_at = map_from_sensor(CAMERA.pose, state)[:3, 0]
    assert looks_at[2] == pytest.approx(np.cos(yaw_rad) * along[2], abs=1e-4)


def matrix(transform: object) -> np.ndarray:
    """(4, 4) matrix of a geometry_msgs/Transform."""
    t, q = transform.translation, transform.rotation
    result = matrices_from_xyz_rpy(np.array([t.x, t.y, t.z]), np.zeros(3))
    x, y, z, w = q.x, q.y, q.z, q.w
    result[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return result
