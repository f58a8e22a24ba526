"""The whole stack detects and tracks objects in clouds of an analytic lidar."""

import numpy as np
import pytest
from analytic_lidar import HEIGHT_M, Block, scan

from simbev_ros.reference_stack.grid import CHANNELS, GridShape
from simbev_ros.reference_stack.pipeline import Answer, Pipeline, resolution_of

EGO_FROM_LIDAR = np.eye(4)
EGO_FROM_LIDAR[2, 3] = HEIGHT_M
SHAPE = GridShape(100, 100, 0.5)
STEP_S = 0.05
CAR_SIZE_M, PEDESTRIAN_SIZE_M = (4.4, 1.9, 1.5), (0.6, 0.5, 1.75)


def _drive(frames: int) -> list[Answer]:
    """Drive the ego along y at 5 m/s; a car is ahead at 8 m/s, a pedestrian crosses behind it at 1.5 m/s."""
    pipeline, answers = Pipeline(EGO_FROM_LIDAR, SHAPE), []
    for frame in range(frames):
        time_s = frame * STEP_S
        blocks = [
            Block(12.0 + 3.0 * time_s, 1.0, 0.0, CAR_SIZE_M),
            Block(-8.0 - 5.0 * time_s, -3.0 + 1.5 * time_s, np.pi / 2, PEDESTRIAN_SIZE_M),
        ]
        map_from_ego = np.eye(4)
        map_from_ego[:2, :2] = [[0.0, -1.0], [1.0, 0.0]]
        map_from_ego[:3, 3] = 1000.0, 5.0 * time_s, 7.0
        answers.append(pipeline.step(*scan(blocks), map_from_ego, 100.0 + time_s))
    return answers


@pytest.fixture(scope="module")
def drive() -> list[Answer]:
    return _drive(30)


def test_car_and_pedestrian_have_their_position_and_velocity_in_the_map(drive: list[Answer]) -> None:
    boxes, time_s = drive[-1].boxes, 29 * STEP_S
    (car,), (pedestrian,) = boxes[boxes["class"] == 0], boxes[boxes["class"] == 5]
    assert [car[name] for name in "xyz"] == pytest.approx([999.0, 12.0 + 8.0 * time_s, 7.75], abs=0.2)
    assert [car["vx"], car["vy"]] == pytest.approx([0.0, 8.0], abs=0.3)
    assert car["yaw"] == pytest.approx(np.pi / 2, abs=0.05)
    assert [pedestrian[name] for name in "xyz"] == pytest.approx([1003.0 - 1.5 * time_s, -8.0, 7.87], abs=0.2)
    assert [pedestrian["vx"], pedestrian["vy"]] == pytest.approx([-1.5, 0.0], abs=0.2)
    assert np.abs(pedestrian["yaw"]) == pytest.approx(np.pi, abs=0.2)
    assert min(car["score"], pedestrian["score"]) > 0.8


def test_tracks_keep_their_ids(drive: list[Answer]) -> None:
    assert len({int(number) for answer in drive[2:] for number in answer.boxes["id"]}) == 2


def test_grid_has_the_car_ahead_and_the_road_around(drive: list[Answer]) -> None:
    scores = drive[-1].scores
    assert scores.shape == (100, 100, len(CHANNELS))
    x, y = (12.0 + 3.0 * 29 * STEP_S), 1.0
    row, column = round(49.5 - x / 0.5), round(49.5 - y / 0.5)
    assert scores[row, column, CHANNELS.index("car")] > 200
    assert scores[45:55, 45:55, CHANNELS.index("road")].min() > 200
    assert not scores[..., [CHANNELS.index(name) for name in ("hazard", "sidewalk", "rider")]].any()


def test_same_clouds_lead_to_the_same_bytes(drive: list[Answer]) -> None:
    again = _drive(8)
    for one, other in zip(drive, again, strict=False):
        assert one.boxes.tobytes() == other.boxes.tobytes()
        assert np.array_equal(one.scores, other.scores)


def test_points_that_are_not_finite_are_ignored() -> None:
    points, ring = scan([Block(12.0, 1.0, 0.0, CAR_SIZE_M)])
    bad = np.array([[np.nan, 0.0, 0.0], [0.0, np.inf, 0.0]])
    answers = [
        Pipeline(EGO_FROM_LIDAR, SHAPE).step(cloud, rings, np.eye(4), 1.0)
        for cloud, rings in ((points, ring), (np.concatenate([bad, points]), np.concatenate([[3, 99], ring])))
    ]
    assert len(answers[0].boxes) == 1
    assert answers[0].boxes.tobytes() == answers[1].boxes.tobytes()


def test_empty_clouds_lead_to_empty_answers() -> None:
    pipeline = Pipeline(EGO_FROM_LIDAR, SHAPE)
    for stamp_s in (1.0, 1.05):
        answer = pipeline.step(np.zeros((0, 3)), np.zeros(0, np.int64), np.eye(4), stamp_s)
        assert len(answer.boxes) == 0
        assert not answer.scores.any()


def test_lidar_may_be_mounted_at_any_yaw() -> None:
    points, ring = scan([Block(12.0, 1.0, 0.0, CAR_SIZE_M)])
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    mount = EGO_FROM_LIDAR.copy()
    mount[:3, :3] = turn
    straight = Pipeline(EGO_FROM_LIDAR, SHAPE).step(points, ring, np.eye(4), 1.0).boxes
    turned = Pipeline(mount, SHAPE).step(points @ turn, ring, np.eye(4), 1.0).boxes
    for name in ("x", "y", "z", "length"):
        assert turned[name] == pytest.approx(straight[name])


def test_resolution_equals_that_of_the_lidar() -> None:
    resolution = resolution_of(*scan([Block(5.0, 0.0, 0.0, (1.0, 40.0, 8.0))]))
    assert resolution.ring_rad == pytest.approx(np.radians(40 / 31), rel=0.01)
    assert resolution.column_rad == pytest.approx(2 * np.pi / 1024, rel=0.01)
