"""Objects with known motion are tracked with their position, velocity and size."""

import numpy as np
import pytest

from simbev_ros.reference_stack.arrays import Floats, Table
from simbev_ros.reference_stack.box_fit import Rectangles
from simbev_ros.reference_stack.classes import load_kinds
from simbev_ros.reference_stack.kalman import correct, predict
from simbev_ros.reference_stack.readings import Readings, Resolution, read_rectangles
from simbev_ros.reference_stack.tracker import Tracker, scores

KINDS = load_kinds()
STEP_S = 0.05


def _cars(*centers_m: tuple[float, float], yaw_rad: float = 0.0) -> Readings:
    """Readings of complete outlines of cars."""
    count = len(centers_m)
    rectangles = Rectangles(
        center_m=np.array(centers_m).reshape(-1, 2),
        yaw_rad=np.full(count, yaw_rad),
        side_m=np.tile([4.4, 1.98], (count, 1)),
        top_m=np.full(count, 1.48),
        ground_m=np.zeros(count),
        points=np.full(count, 100),
    )
    return read_rectangles(rectangles, KINDS, np.zeros(2), Resolution(0.004, 0.002))


def _follow(tracker: Tracker, velocity_mps: Floats, steps: int, first: int = 0) -> Table:
    """Track a car from (10, 5) at constant velocity."""
    tracks = tracker.tracks
    for step in range(first, first + steps):
        x, y = np.array([10.0, 5.0]) + velocity_mps * step * STEP_S
        course = float(np.arctan2(velocity_mps[1], velocity_mps[0]))
        tracks = tracker.step(_cars((x, y), yaw_rad=course), 100.0 + step * STEP_S, 0.0)
    return tracks


def test_filter_of_exact_positions_has_the_exact_velocity() -> None:
    state, covariance = np.zeros((1, 4)), np.eye(4)[None] * 1e6
    for step in range(5):
        state, covariance = predict(state, covariance, 0.1, 0.0)
        state, covariance = correct(
            state, covariance, np.array([[1.0 + 0.3 * step, -0.1 * step]]), np.eye(2)[None] * 1e-6
        )
    assert state[0] == pytest.approx([2.2, -0.4, 3.0, -1.0], abs=1e-4)


def test_filter_weighs_positions_by_their_noise() -> None:
    state, covariance = correct(
        np.zeros((1, 4)), np.eye(4)[None] * 3.0, np.array([[4.0, 4.0]]), np.diag([1.0, 3.0])[None]
    )
    assert state[0, :2] == pytest.approx([3.0, 2.0])
    assert np.diag(covariance[0])[:2] == pytest.approx([0.75, 1.5])


@pytest.mark.parametrize("velocity_mps", [(8.0, 0.0), (-6.0, 3.0), (0.0, -10.0)])
def test_car_has_its_velocity_and_heads_in_its_direction(velocity_mps: tuple[float, float]) -> None:
    velocity = np.array(velocity_mps)
    (track,) = _follow(Tracker(KINDS), velocity, 20)
    assert track["state"][2:] == pytest.approx(velocity, abs=0.2)
    assert track["state"][:2] == pytest.approx(np.array([10.0, 5.0]) + velocity * 19 * STEP_S, abs=0.1)
    assert np.cos(track["yaw"] - np.arctan2(velocity[1], velocity[0])) > 0.999
    assert track["size_m"] == pytest.approx([4.4, 1.98, 1.48], abs=0.01)


def test_track_survives_a_gap_and_keeps_its_id() -> None:
    tracker, velocity = Tracker(KINDS), np.array([8.0, 0.0])
    before = _follow(tracker, velocity, 20)
    for step in range(20, 25):
        assert len(tracker.step(_cars(), 100.0 + step * STEP_S, 0.0)) == 0
    after = _follow(tracker, velocity, 5, first=25)
    assert before["id"].tolist() == after["id"].tolist() == [1]


def test_cars_that_pass_each_other_keep_their_tracks() -> None:
    tracker = Tracker(KINDS)
    for step in range(40):
        along_m = 10.0 * step * STEP_S
        tracks = tracker.step(_cars((along_m, 2.0), (20.0 - along_m, -2.0)), step * STEP_S, 0.0)
    assert tracks["state"][np.argsort(tracks["id"]), 2] == pytest.approx([10.0, -10.0], abs=0.3)


def test_jump_in_time_starts_tracking_anew() -> None:
    tracker = Tracker(KINDS)
    _follow(tracker, np.array([8.0, 0.0]), 10)
    assert tracker.step(_cars((10.0, 5.0)), 50.0, 0.0)["readings"].tolist() == [1]


def test_moving_object_scores_higher_than_stationary_and_new_ones() -> None:
    standing, moving = Tracker(KINDS), Tracker(KINDS)
    new = scores(_follow(standing, np.zeros(2), 1), KINDS)
    stationary = scores(_follow(standing, np.zeros(2), 19, first=1), KINDS)
    moved = scores(_follow(moving, np.array([8.0, 0.0]), 20), KINDS)
    assert 0 < new < stationary < moved < 1


def test_partly_seen_car_is_completed_away_from_the_sensor() -> None:
    rectangle = Rectangles(
        np.array([[20.0, 0.0]]), np.zeros(1), np.array([[0.2, 1.98]]), np.array([1.48]), np.zeros(1), np.array([30])
    )
    rear = read_rectangles(rectangle, KINDS, np.zeros(2), Resolution(0.004, 0.002))
    (track,) = Tracker(KINDS).step(rear, 1.0, 0.0)
    assert track["state"][:2] == pytest.approx([20.0 + (4.4 - 0.2) / 2, 0.0], abs=0.05)
    assert track["yaw"] == pytest.approx(0.0)
