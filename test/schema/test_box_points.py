import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from synthetic_world import actor, box_model, world

from simbev_ros.config.sensor import Pose
from simbev_ros.foundation.semantics import BOX_CLASSES, DIFFICULTIES, Tag
from simbev_ros.foundation.types import Float64Array, Int64Array, Table
from simbev_ros.schema.box_points import BoxLookup, add_point_counts
from simbev_ros.schema.boxes import BOX_DTYPE, difficulty
from simbev_ros.schema.map_points import map_points
from simbev_ros.schema.points import POINT_DTYPE
from simbev_ros.simulation.sensors.mount import map_from_sensor

RANDOM = np.random.default_rng(8)


def random_boxes(count: int, around_m: tuple[float, float, float], spread_m: float) -> Table:
    boxes = np.zeros(count, BOX_DTYPE)
    for axis, name in enumerate("xyz"):
        boxes[name] = around_m[axis] + RANDOM.uniform(-1.0, 1.0, count) * (spread_m, spread_m, 2.0)[axis]
    boxes["yaw"] = RANDOM.uniform(-np.pi, np.pi, count)
    boxes["roll"], boxes["pitch"] = RANDOM.normal(size=(2, count)) * RANDOM.choice([0.0, 0.05, 2.0], count)
    for name in "length", "width", "height":
        boxes[name] = RANDOM.uniform(0.0, 6.0, count)
    return boxes


def box(length: float = 4.0, width: float = 2.0, height: float = 1.0, **columns: float) -> Table:
    row = np.zeros(1, BOX_DTYPE)
    for name, value in {"length": length, "width": width, "height": height, **columns}.items():
        row[name] = value
    return row


def count_by_brute_force(boxes: Table, points_m: Float64Array) -> Int64Array:
    """Slow reference: SciPy's rotations, one box at a time."""
    counts = []
    for row in boxes:
        rotation = Rotation.from_euler("xyz", [row["roll"], row["pitch"], row["yaw"]])
        with np.errstate(invalid="ignore"):
            local_m = (points_m - [row["x"], row["y"], row["z"]]) @ rotation.as_matrix()
        inside = np.abs(local_m) <= np.array([row["length"], row["width"], row["height"]], np.float64) / 2.0
        counts.append(int(inside.all(axis=1).sum()))
    return np.array(counts)


@pytest.mark.parametrize("around_m", [(0.0, 0.0, 0.0), (1e5, -1e5, 300.0)])
@pytest.mark.parametrize("spread_m", [3.0, 60.0, 20_000.0])
def test_counts_agree_with_brute_force(around_m: tuple[float, float, float], spread_m: float) -> None:
    boxes = random_boxes(150, around_m, spread_m)
    boxes["length"][:5] = boxes["height"][5:10] = 0.0
    centers_m = np.stack([boxes["x"], boxes["y"], boxes["z"]], axis=1)
    near_m = RANDOM.choice(centers_m, 30_000) + RANDOM.normal(size=(30_000, 3)) * 2.0
    points_m = np.concatenate([centers_m, near_m, RANDOM.uniform(-2e5, 2e5, (5_000, 3))])
    points_m[::50, RANDOM.integers(0, 3)] = np.nan
    points_m[25::50] = np.inf
    counts = BoxLookup(boxes).count(points_m)
    assert counts.dtype == np.int32
    assert counts.sum() > 1_000
    np.testing.assert_array_equal(counts, count_by_brute_force(boxes, points_m))


def test_faces_edges_and_corners_are_inside_and_points_next_to_them_are_not() -> None:
    lattice = np.stack(np.meshgrid(*[np.linspace(-1.0, 1.0, 5)] * 3), axis=-1).reshape(-1, 3)
    on_m = lattice * [2.0, 1.0, 0.5] + [1e5, -1e5, 64.0]
    surface = (np.abs(lattice) == 1.0).any(axis=1)
    beyond_m = lattice[surface] * [2.0, 1.0, 0.5] * (1.0 + 1e-8) + [1e5, -1e5, 64.0]
    one = box(x=1e5, y=-1e5, z=64.0)
    assert BoxLookup(one).count(on_m) == [125]
    assert BoxLookup(one).count(beyond_m) == [0]


def test_a_point_in_two_boxes_counts_for_both() -> None:
    nested = np.concatenate([box(), box(1.0, 1.0, 1.0, yaw=0.3), box(z=3.0)])
    assert BoxLookup(nested).count(np.array([[0.1, 0.1, 0.1], [1.9, 0.0, 0.0]])).tolist() == [2, 1, 0]


def test_a_flat_box_contains_the_points_in_its_plane() -> None:
    assert BoxLookup(box(height=0.0)).count(np.array([[1.0, 0.5, 0.0], [1.0, 0.5, 1e-9]])) == [1]


def test_points_that_are_not_finite_are_in_no_box() -> None:
    points_m = np.full((3, 3), 0.0) + np.diag([np.nan, np.inf, -np.inf])
    assert BoxLookup(box(roll=0.3)).count(points_m) == [0]


def test_no_boxes_and_no_points_give_empty_and_zero_counts() -> None:
    assert BoxLookup(box()).count(np.empty((0, 3))).tolist() == [0]
    assert BoxLookup(np.zeros(0, BOX_DTYPE)).count(np.ones((5, 3))).shape == (0,)
    assert len(add_point_counts(np.zeros(0, BOX_DTYPE), [np.ones((5, 3))], [])) == 0


def test_a_point_of_a_tilted_sensor_on_a_turned_ego_matches_a_hand_calculation() -> None:
    car = box_model(Tag.CAR, (4.0, 2.0, 1.5))
    state = world(actor(car, x=10_000.0, y=20_000.0, z=5.0, yaw=math.pi / 2))
    cloud = np.zeros(2, POINT_DTYPE)
    cloud["x"], cloud["y"], cloud["z"] = [3.0, 0.0], [0.0, 1.0], [0.0, 0.0]
    points_m = map_points(cloud, map_from_sensor(Pose(x_m=1.0, z_m=2.0, pitch_deg=90.0), state))
    np.testing.assert_allclose(points_m, [[10_000.0, 20_001.0, 4.0], [9_999.0, 20_001.0, 7.0]], atol=1e-6)


def test_a_rolling_scan_uses_the_ego_pose_at_the_time_of_each_point() -> None:
    car, lag_s, turn_radps = box_model(Tag.CAR, (4.0, 2.0, 1.5)), 0.1, 0.6
    mount = Pose(x_m=1.0, y_m=0.5, z_m=2.0, yaw_deg=30.0)
    state = world(actor(car, x=1e4, y=200.0, z=3.0, yaw=0.4, vx=15.0, vy=-2.0, vz=0.5, wz=turn_radps))
    then = world(actor(car, x=1e4 - 1.5, y=200.2, z=2.95, yaw=0.4 - lag_s * turn_radps))
    cloud = np.zeros(40, POINT_DTYPE)
    for name in "xyz":
        cloud[name] = RANDOM.uniform(-100.0, 100.0, 40)
    at_stamp_m = map_points(cloud, map_from_sensor(mount, state), state.ego)
    np.testing.assert_allclose(at_stamp_m, map_points(cloud, map_from_sensor(mount, state)), atol=1e-9)
    cloud["time"] = -lag_s
    found_m = map_points(cloud, map_from_sensor(mount, state), state.ego)
    np.testing.assert_allclose(found_m, map_points(cloud, map_from_sensor(mount, then)), atol=1e-4)


def test_points_of_all_sensors_of_a_kind_add_up() -> None:
    boxes = np.concatenate([box(distance=10.0), box(x=10.0, distance=10.0)])
    inside, outside = np.zeros((3, 3)), np.full((3, 3), 5.0)
    found = add_point_counts(boxes, [inside, outside, inside], [inside])
    assert found["lidar_points"].tolist() == [6, 0]
    assert found["radar_points"].tolist() == [3, 0]
    assert found["valid"].tolist() == [1, 0]
    np.testing.assert_array_equal(boxes["lidar_points"], 0)


def test_a_sensor_kind_that_was_not_received_is_minus_one_and_counts_as_no_points() -> None:
    found = add_point_counts(box(distance=10.0), None, [np.zeros((100, 3))])
    assert (found["lidar_points"], found["radar_points"], found["valid"]) == (-1, 100, 1)
    assert DIFFICULTIES[found["difficulty"][0]] == "easy"
    found = add_point_counts(box(distance=10.0), None, None)
    assert (found["lidar_points"], found["radar_points"], found["valid"]) == (-1, -1, 0)
    assert DIFFICULTIES[found["difficulty"][0]] == "hard"
    assert add_point_counts(box(), [np.empty((0, 3))], [])["lidar_points"] == [0]


@pytest.mark.parametrize(
    ("names", "hard", "medium"),
    [
        ("car", (60.0, 30), (30.0, 80)),
        ("truck bus", (80.0, 40), (40.0, 100)),
        ("pedestrian motorcycle bicycle", (40.0, 20), (20.0, 40)),
        ("traffic_light traffic_sign traffic_cone barrier", (40.0, 10), (20.0, 20)),
    ],
)
def test_difficulty_follows_distance_and_number_of_points(
    names: str, hard: tuple[float, int], medium: tuple[float, int]
) -> None:
    cases = [
        (medium[0] - 0.01, medium[1], "easy"),
        (medium[0], medium[1], "medium"),
        (0.0, medium[1] - 1, "medium"),
        (hard[0] - 0.01, hard[1], "medium"),
        (hard[0], 10_000, "hard"),
        (0.0, hard[1] - 1, "hard"),
    ]
    for name in names.split():
        distance_m, points, expected = zip(*cases, strict=True)
        classes = np.full(len(cases), BOX_CLASSES.index(name), np.uint8)
        found = difficulty(classes, np.array(distance_m, np.float32), np.array(points))
        assert [DIFFICULTIES[rank] for rank in found] == list(expected)
