"""Each column at its own time: what a deskewing stack undoes with the odometry must fall back on the meshes."""

from collections.abc import Sequence

import numpy as np
import pytest
from point_distance import distances_m
from scipy.spatial.transform import Rotation, Slerp
from synthetic_world import EGO_ID, TICK_NS, actor, box_model, mesh, sheet, static_scene, world

from simbev_ros.assets.actors.actor_model import ActorModel
from simbev_ros.assets.actors.catalogue import load_models
from simbev_ros.assets.actors.posing import pose_actors
from simbev_ros.assets.materials import Material
from simbev_ros.config.lidar import Lidar
from simbev_ros.config.sensor import Pose
from simbev_ros.raycast.scene import RayScene
from simbev_ros.scene.interpolation import Course
from simbev_ros.scene.state import WorldState
from simbev_ros.semantics import Tag
from simbev_ros.sensors.lidar import LidarModel, LidarScan
from simbev_ros.types import Float64Array, Table

TICK_S = TICK_NS * 1e-9
PLACE_M = np.array([1200.0, -800.0])
GROUND = mesh(sheet([-200, -200], [200, 200]), Tag.ROAD, Material.ASPHALT)


def lidar(**properties: object) -> Lidar:
    defaults: dict[str, object] = {"channels": 24, "columns": 720, "lower_fov_deg": -20.0, "upper_fov_deg": 4.0}
    quiet = {"drop_off": 0.0, "range_noise_sigma_m": 0.0, "rolling": True}
    mount = Pose(x_m=0.4, y_m=-0.3, z_m=2.1, yaw_deg=20.0, pitch_deg=3.0)
    return Lidar.model_validate({"type": "lidar", "name": "top", "pose": mount} | defaults | quiet | properties)


def scan(sensor: Lidar, models: Sequence[ActorModel], states: list[WorldState]) -> LidarScan:
    *earlier, now = states
    rays = RayScene(static_scene(GROUND, origin_m=(*PLACE_M, 0.0)), models)
    hidden_ids = frozenset() if sensor.hits_own_vehicle else now.ego_ids
    place_m = np.array([now.ego["x"], now.ego["y"], now.ego["z"]])
    rays.update(now, place_m, sensor.range_m, hidden_ids, earlier)
    return LidarModel(sensor, 1, len(earlier) * TICK_S).scan(rays, now, earlier)


def deskewed(sensor: Lidar, cloud: Table, states: list[WorldState]) -> Float64Array:
    """(N, 3) map frame: with poses between those of the odometry, as tf2 interpolates them."""
    stamps_s = np.array([state.stamp_ns for state in states]) * 1e-9
    xyz = np.array([[state.ego[axis] for axis in "xyz"] for state in states])
    rpy = np.array([[state.ego[angle] for angle in ("roll", "pitch", "yaw")] for state in states])
    times_s = stamps_s[-1] + cloud["time"].astype(np.float64)
    turn = Slerp(stamps_s, Rotation.from_euler("xyz", rpy))(np.clip(times_s, stamps_s[0], stamps_s[-1]))
    place_m = np.column_stack([np.interp(times_s, stamps_s, axis) for axis in xyz.T])
    points = np.column_stack([cloud["x"], cloud["y"], cloud["z"]]).astype(np.float64)
    mount = sensor.pose.ego_from_sensor
    return turn.apply(points @ mount[:3, :3].T + mount[:3, 3]) + place_m


def traffic(models: Sequence[ActorModel], ticks: int) -> list[WorldState]:
    """A turning ego among a car, a bicycle and a pedestrian, all of them moving, at the given number of ticks + 1."""
    index = {model.blueprint: k for k, model in enumerate(models)}
    walker = next(k for name, k in index.items() if name.startswith("pedestrian"))
    ways = [
        (EGO_ID, index["vehicle.sedan"], (0.0, 0.0), (14.0, 1.0), 0.1, 0.5),
        (20, index["vehicle.sedan"], (12.0, 3.5), (-16.0, 0.5), 3.1, 0.2),
        (21, index["vehicle.bus"], (-14.0, -5.0), (9.0, -1.0), -0.1, 0.3),
        (22, walker, (5.0, -4.0), (1.2, 1.4), 0.8, 0.0),
    ]
    states = []
    for tick in range(-ticks, 1):
        time_s, rows = tick * TICK_S, []
        for number, blueprint, at_m, velocity_mps, yaw, spin in ways:
            x, y = PLACE_M + at_m + np.multiply(velocity_mps, time_s)
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
    states = traffic(models, ticks)
    found = scan(sensor, models, states)
    cloud = found.semantic_points
    assert cloud is not None
    assert found.points is not None
    assert found.points["time"].tobytes() == cloud["time"].tobytes()
    points = deskewed(sensor, cloud, states)
    assert np.abs(points[cloud["object_id"] == 0, 2]).max() < 2e-3
    course = Course.of(states[-1], states[:-1])
    for row in range(1, 4):
        mine = cloud["object_id"] == states[-1].actors["id"][row]
        assert mine.sum() > 25
        for time_s in np.unique(cloud["time"][mine]):
            then = course.at(np.array([row]), np.array([-float(time_s)]))
            posed = pose_actors(models, then, np.array([*PLACE_M, 0.0]))
            corners = posed.vertices.astype(np.float64)[posed.triangles]
            here = mine & (cloud["time"] == time_s)
            assert distances_m(points[here] - [*PLACE_M, 0.0], corners).max() < 3e-3


def test_without_motion_a_rolling_scan_is_that_of_the_stamp() -> None:
    models = (box_model(Tag.CAR, (4.0, 2.0, 1.5)),)
    rows = [
        actor(models[0], x=PLACE_M[0], y=PLACE_M[1]),
        actor(models[0], id=9, x=PLACE_M[0] + 9.0, y=PLACE_M[1], yaw=1.0),
    ]
    states = [world(*rows, tick=tick) for tick in range(3)]
    rolling = scan(lidar(), models, states).points
    still = scan(lidar(rolling=False), models, states).points
    assert rolling is not None
    assert still is not None
    for name in ("x", "y", "z"):
        assert rolling[name] == pytest.approx(still[name], abs=1e-4)
    assert rolling["time"].tobytes() == still["time"].tobytes()


def test_a_car_that_passes_is_stretched_by_its_way_during_the_turn() -> None:
    models = (box_model(Tag.CAR, (4.0, 2.0, 1.5)),)

    def at(tick: int) -> WorldState:
        beside = actor(models[0], id=9, x=PLACE_M[0] + 20.0 * tick * TICK_S, y=PLACE_M[1] + 4.0, vx=20.0)
        return world(actor(models[0], x=PLACE_M[0], y=PLACE_M[1]), beside, tick=tick)

    sensor = lidar(pose=Pose(z_m=1.0), columns=3600, channels=1, lower_fov_deg=0.0, upper_fov_deg=0.0)
    cloud = scan(sensor, models, [at(-2), at(-1), at(0)]).semantic_points
    assert cloud is not None
    side = (cloud["object_id"] == 9) & (np.abs(cloud["y"] - 3.0) < 1e-3)
    # Its near side is swept from the rear, seen first, to the front, seen later, while it drives on.
    times_s, x = cloud["time"][side].astype(np.float64), cloud["x"][side].astype(np.float64)
    assert x[0] == pytest.approx(-2.0 + 20.0 * times_s[0], abs=0.03)
    assert x[-1] == pytest.approx(2.0 + 20.0 * times_s[-1], abs=0.03)
    assert np.ptp(x) > 4.3
