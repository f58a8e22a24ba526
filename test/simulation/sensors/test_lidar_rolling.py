"""A rolling scan casts each column at its own time; deskewed with the odometry, its points lie on the meshes again."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from point_distance import distances_m, xyz
from scipy.spatial.transform import Rotation, Slerp
from synthetic_world import EGO_ID, TICK_NS, actor, box_model, mesh, sheet, static_scene, world

from simbev_ros.assets.actors.actor_model import ActorModel
from simbev_ros.assets.actors.catalog import load_models
from simbev_ros.assets.actors.posing import pose_actors
from simbev_ros.assets.materials import Material
from simbev_ros.config.lidar import Lidar
from simbev_ros.config.sensor import Pose
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Float32Array, Float64Array, Table
from simbev_ros.scene.interpolation import ActorHistory
from simbev_ros.schema.scene.agents import STATION_IDS
from simbev_ros.schema.scene.state import ACTOR_DTYPE, WorldState
from simbev_ros.simulation.raycast.scene import RayScene
from simbev_ros.simulation.sensors.lidar import LidarModel, LidarScan

TICK_S = TICK_NS * 1e-9
POSITION_M = np.array([1200.0, -800.0])
GROUND = mesh(sheet([-200, -200], [200, 200]), Tag.ROAD, Material.ASPHALT)


def lidar(**properties: object) -> Lidar:
    defaults: dict[str, object] = {"channels": 24, "columns": 720, "lower_fov_deg": -20.0, "upper_fov_deg": 4.0}
    quiet = {"drop_off": 0.0, "range_noise_sigma_m": 0.0, "rolling": True}
    mount = Pose(x_m=0.4, y_m=-0.3, z_m=2.1, yaw_deg=20.0, pitch_deg=3.0)
    return Lidar.model_validate({"type": "lidar", "name": "top", "pose": mount} | defaults | quiet | properties)


def scan(sensor: Lidar, models: Sequence[ActorModel], states: list[WorldState]) -> LidarScan:
    *earlier, now = states
    rays = RayScene(static_scene(GROUND, origin_m=(*POSITION_M, 0.0)), models)
    hidden_ids = frozenset() if sensor.hits_own_vehicle else now.ego_ids
    position_m = np.array([now.ego["x"], now.ego["y"], now.ego["z"]])
    rays.update(now, position_m, sensor.range_m, hidden_ids, earlier)
    return LidarModel(sensor, 1, len(earlier) * TICK_S).scan(rays, now, earlier)


def deskew(sensor: Lidar, cloud: Table, states: list[WorldState]) -> Float64Array:
    """(N, 3) points in the map frame, deskewed with poses interpolated from the odometry as tf2 does."""
    stamps_s = np.array([state.stamp_ns for state in states]) * 1e-9
    ego_m = np.array([[state.ego[axis] for axis in "xyz"] for state in states])
    rpy = np.array([[state.ego[angle] for angle in ("roll", "pitch", "yaw")] for state in states])
    times_s = stamps_s[-1] + cloud["time"].astype(np.float64)
    turn = Slerp(stamps_s, Rotation.from_euler("xyz", rpy))(np.clip(times_s, stamps_s[0], stamps_s[-1]))
    position_m = np.column_stack([np.interp(times_s, stamps_s, axis) for axis in ego_m.T])
    mount = sensor.pose.ego_from_sensor
    return turn.apply(xyz(cloud) @ mount[:3, :3].T + mount[:3, 3]) + position_m


def moving_traffic(models: Sequence[ActorModel], ticks: int) -> list[WorldState]:
    """States of a turning ego among a moving car, bus and pedestrian, at the given number of ticks + 1."""
    index = {model.blueprint: k for k, model in enumerate(models)}
    walker = next(k for name, k in index.items() if name.startswith("pedestrian"))
    tracks = [
        (EGO_ID, index["vehicle.sedan"], (0.0, 0.0), (14.0, 1.0), 0.1, 0.5),
        (20, index["vehicle.sedan"], (12.0, 3.5), (-16.0, 0.5), 3.1, 0.2),
        (21, index["vehicle.bus"], (-14.0, -5.0), (9.0, -1.0), -0.1, 0.3),
        (22, walker, (5.0, -4.0), (1.2, 1.4), 0.8, 0.0),
    ]
    states = []
    for tick in range(-ticks, 1):
        time_s, rows = tick * TICK_S, []
        for number, blueprint, at_m, velocity_mps, yaw, spin in tracks:
            x, y = POSITION_M + at_m + np.multiply(velocity_mps, time_s)
            speed = float(np.hypot(*velocity_mps))
            pose = {"x": x, "y": y, "z": 0.1 * time_s, "yaw": yaw + spin * time_s, "pitch": 0.05 * time_s}
            turning = {
                "wheel": 900.0 + speed * time_s / 0.33,
                "steer": 0.1 + time_s,
                "gait": (6.0 + 7.0 * time_s) % 6.28,
            }
            motion = {"vx": velocity_mps[0], "vy": velocity_mps[1]}
            rows.append(actor(models[blueprint], blueprint, id=number, **pose, **turning, **motion))
        states.append(world(*rows, tick=tick))
    return states


@pytest.mark.parametrize("ticks", [1, 2])
def test_a_rolling_scan_deskewed_with_the_odometry_lies_on_the_moving_meshes(ticks: int) -> None:
    models, sensor = load_models(), lidar()
    states = moving_traffic(models, ticks)
    found = scan(sensor, models, states)
    cloud = found.semantic_points
    assert cloud is not None
    assert found.points is not None
    assert found.points["time"].tobytes() == cloud["time"].tobytes()
    points = deskew(sensor, cloud, states)
    assert np.abs(points[cloud["object_id"] == 0, 2]).max() < 2e-3
    course = ActorHistory.of(states[-1], states[:-1])
    for row in range(1, 4):
        of_actor = cloud["object_id"] == states[-1].actors["id"][row]
        assert of_actor.sum() > 25
        assert_on_moving_mesh(models, course, row, points[of_actor], cloud["time"][of_actor])


def assert_on_moving_mesh(
    models: Sequence[ActorModel], course: ActorHistory, row: int, points: Float64Array, time_s: Float32Array
) -> None:
    """Assert that (N, 3) points, map frame, lie on an actor's mesh where it was at the (N,) times of the points."""
    for time in np.unique(time_s):
        posed_rows = course.at(np.array([row]), np.array([-float(time)]))
        posed = pose_actors(models, posed_rows, np.array([*POSITION_M, 0.0]))
        corners = posed.vertices.astype(np.float64)[posed.triangles]
        assert distances_m(points[time_s == time] - [*POSITION_M, 0.0], corners).max() < 3e-3


def seen_from_a_mast(states: Sequence[WorldState], yaw_rad: float) -> list[WorldState]:
    """The states as a roadside unit sees them; its mast, which is not an actor, stands between the lanes."""
    row = np.zeros((), ACTOR_DTYPE)
    row["id"], row["z"], row["yaw"] = STATION_IDS, 0.2, yaw_rad
    row["x"], row["y"] = POSITION_M + np.array([2.0, 9.0])
    return [replace(state, ego_id=STATION_IDS, station=row) for state in states]


def test_a_rolling_scan_of_a_roadside_unit_lies_on_the_moving_meshes() -> None:
    models, sensor = load_models(), lidar()
    states = seen_from_a_mast(moving_traffic(models, 2), yaw_rad=0.7)
    cloud = scan(sensor, models, states).semantic_points
    assert cloud is not None
    points = deskew(sensor, cloud, states)  # with the constant pose of the mast
    assert np.abs(points[cloud["object_id"] == 0, 2]).max() < 2e-3
    course = ActorHistory.of(states[-1], states[:-1])
    assert set(course.now["id"].tolist()) <= set(cloud["object_id"].tolist()), "it sees all actors"
    for row, number in enumerate(course.now["id"]):
        of_actor = cloud["object_id"] == number
        assert_on_moving_mesh(models, course, row, points[of_actor], cloud["time"][of_actor])


def test_in_front_of_a_roadside_unit_only_traffic_moves_during_a_turn() -> None:
    models = (box_model(Tag.CAR, (4.0, 2.0, 1.5)),)
    rows = [actor(models[0], id=9, x=POSITION_M[0] + 9.0, y=POSITION_M[1], yaw=1.0)]
    states = seen_from_a_mast([world(*rows, tick=tick) for tick in range(3)], yaw_rad=0.7)
    rolling = scan(lidar(), models, states).points
    still = scan(lidar(rolling=False), models, states).points
    assert rolling is not None
    assert still is not None
    for name in ("x", "y", "z"):
        assert rolling[name] == pytest.approx(still[name], abs=1e-4)


def test_without_motion_a_rolling_scan_equals_the_scan_at_the_stamp() -> None:
    models = (box_model(Tag.CAR, (4.0, 2.0, 1.5)),)
    rows = [
        actor(models[0], x=POSITION_M[0], y=POSITION_M[1]),
        actor(models[0], id=9, x=POSITION_M[0] + 9.0, y=POSITION_M[1], yaw=1.0),
    ]
    states = [world(*rows, tick=tick) for tick in range(3)]
    rolling = scan(lidar(), models, states).points
    still = scan(lidar(rolling=False), models, states).points
    assert rolling is not None
    assert still is not None
    for name in ("x", "y", "z"):
        assert rolling[name] == pytest.approx(still[name], abs=1e-4)
    turn_s, columns = 2 * TICK_S, lidar().columns
    column = np.rint(rolling["time"] / turn_s * columns)
    assert rolling["time"] == pytest.approx(column / columns * turn_s, abs=1e-6)
    assert column[0] == 1 - columns and column[-1] == 0 and (np.diff(column) >= 0).all()
    assert not still["time"].any()


def test_a_passing_car_is_stretched_by_the_distance_it_drives_during_the_turn() -> None:
    models = (box_model(Tag.CAR, (4.0, 2.0, 1.5)),)

    def at(tick: int) -> WorldState:
        beside = actor(models[0], id=9, x=POSITION_M[0] + 20.0 * tick * TICK_S, y=POSITION_M[1] + 4.0, vx=20.0)
        return world(actor(models[0], x=POSITION_M[0], y=POSITION_M[1]), beside, tick=tick)

    sensor = lidar(pose=Pose(z_m=1.0), columns=3600, channels=1, lower_fov_deg=0.0, upper_fov_deg=0.0)
    cloud = scan(sensor, models, [at(-2), at(-1), at(0)]).semantic_points
    assert cloud is not None
    side = (cloud["object_id"] == 9) & (np.abs(cloud["y"] - 3.0) < 1e-3)
    # Its near side is swept from the rear, seen first, to the front, seen later, while it drives on.
    times_s, x = cloud["time"][side].astype(np.float64), cloud["x"][side].astype(np.float64)
    assert x[0] == pytest.approx(-2.0 + 20.0 * times_s[0], abs=0.03)
    assert x[-1] == pytest.approx(2.0 + 20.0 * times_s[-1], abs=0.03)
    assert np.ptp(x) > 4.3
