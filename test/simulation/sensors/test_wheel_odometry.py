"""Wheel odometry against a planar drive that is integrated here, and its covariances against its errors."""

import numpy as np
import pytest
from analytic_motion import CAR, circle, state_at
from scipy.stats import chi2
from synthetic_world import TICK_NS, actor, world

from simbev_ros.config.odometry import Odometry
from simbev_ros.foundation.geometry.transforms import inverse, matrices_from_xyz_rpy, rpy_from_rotation
from simbev_ros.foundation.types import Float64Array
from simbev_ros.simulation.sensors.odometry import DeadReckoning, OdometryModel, PlanarPose, PlanarTwist

AXLE_M = 1.4
SIGMAS = (
    "speed_scale_sigma", "speed_noise_sigma_mps", "distance_walk_m_per_sqrt_m", "yaw_rate_scale_sigma",
    "yaw_rate_bias_sigma_radps", "yaw_rate_bias_walk_radps_per_sqrt_s", "yaw_rate_noise_sigma_radps",
    "heading_walk_rad_per_sqrt_s",
)  # fmt: skip
PERFECT = dict.fromkeys(SIGMAS, 0.0)
SLOW_TICK_NS = 250_000_000


def odometry(**properties: object) -> Odometry:
    return Odometry.model_validate({"type": "odometry", "name": "wheel"} | properties)


def town_drive(ticks: int, tick_s: float) -> list[Float64Array]:
    """(4, 4) map_from_ego at each tick of a level drive: bends both ways, a stop, and a stretch in reverse.

    The rear axle moves along the heading, by the midpoint rule; the ego frame is ahead of it.
    """
    x_m, y_m, yaw_rad = -40.0, 75.0, 2.5
    poses = []
    for tick in range(ticks):
        poses.append(
            matrices_from_xyz_rpy(
                np.array([x_m + AXLE_M * np.cos(yaw_rad), y_m + AXLE_M * np.sin(yaw_rad), 3.0]),
                np.array([0.0, 0.0, yaw_rad]),
            )
        )
        share = tick / ticks
        speed_mps = 0.0 if 0.4 < share < 0.5 else (-2.0 if 0.5 <= share < 0.6 else 10.0)
        turn_rad = speed_mps * 0.04 * np.sin(9.0 * share) * tick_s
        middle_rad = yaw_rad + turn_rad / 2
        x_m, y_m = x_m + speed_mps * tick_s * np.cos(middle_rad), y_m + speed_mps * tick_s * np.sin(middle_rad)
        yaw_rad += turn_rad
    return poses


def reckon(
    odometry: Odometry, seed: int, poses: list[Float64Array], tick_ns: int, base_link_x_m: float = 0.0
) -> list[PlanarPose]:
    reckoning = DeadReckoning(odometry, seed, tick_ns, AXLE_M, base_link_x_m)
    found = []
    for tick, pose in enumerate(poses):
        reckoning.advance_to(tick, pose)
        found.append(reckoning.pose)
    return found


def true_pose(poses: list[Float64Array], tick: int, base_link_x_m: float = 0.0) -> Float64Array:
    """(3,) x, y and yaw of base_link in the frame that it was in at tick 0."""
    ego_from_base = matrices_from_xyz_rpy(np.array([base_link_x_m, 0.0, 0.0]), np.zeros(3))
    moved = inverse(poses[0] @ ego_from_base) @ poses[tick] @ ego_from_base
    return np.array([*moved[:2, 3], rpy_from_rotation(moved[:3, :3])[2]])


def error_of(found: PlanarPose, true: Float64Array) -> Float64Array:
    error = np.array([found.x_m, found.y_m, found.yaw_rad]) - true
    error[2] = np.angle(np.exp(1j * error[2]))
    return error


@pytest.mark.parametrize("base_link_x_m", [0.0, -AXLE_M])
def test_without_errors_the_pose_is_that_of_base_link_since_the_start(base_link_x_m: float) -> None:
    poses = town_drive(300, TICK_NS / 1e9)
    found = reckon(odometry(**PERFECT), 5, poses, TICK_NS, base_link_x_m)
    for tick in range(0, 300, 13):
        np.testing.assert_allclose(error_of(found[tick], true_pose(poses, tick, base_link_x_m)), 0, atol=1e-9)


def test_the_pose_stands_while_the_wheels_do() -> None:
    poses = [matrices_from_xyz_rpy(np.array([8.0 * min(t, 20) / 20, 0, 0]), np.zeros(3)) for t in range(60)]
    found = reckon(odometry(), 3, poses, TICK_NS)
    assert {(pose.x_m, pose.y_m, pose.yaw_rad) for pose in found[20:]} == {
        (found[20].x_m, found[20].y_m, found[20].yaw_rad)
    }
    np.testing.assert_array_equal(found[59].covariance, found[20].covariance)


@pytest.mark.slow
@pytest.mark.parametrize("base_link_x_m", [0.0, -AXLE_M])
def test_the_covariance_of_the_pose_fits_its_error_over_many_seeds(base_link_x_m: float) -> None:
    """The normalized estimation error squared (Bar-Shalom et al., 2001, 5.4.2) has 3 degrees of freedom."""
    poses, seeds, ticks = town_drive(120, SLOW_TICK_NS / 1e9), 150, (4, 30, 119)
    squares = np.zeros((len(ticks), seeds))
    for seed in range(seeds):
        found = reckon(odometry(), seed, poses, SLOW_TICK_NS, base_link_x_m)
        for row, tick in enumerate(ticks):
            error = error_of(found[tick], true_pose(poses, tick, base_link_x_m))
            squares[row, seed] = error @ np.linalg.solve(found[tick].covariance, error)
    low, high = chi2.ppf([0.0005, 0.9995], 3 * seeds) / seeds
    assert ((low < squares.mean(axis=1)) & (squares.mean(axis=1) < high)).all(), squares.mean(axis=1)


def test_uncertainty_grows_with_the_distance_and_is_a_percent_of_it_ahead() -> None:
    poses = [matrices_from_xyz_rpy(np.array([2.5 * tick, 0, 0]), np.zeros(3)) for tick in range(81)]
    found = reckon(odometry(speed_scale_sigma=0.01, distance_walk_m_per_sqrt_m=0), 1, poses, SLOW_TICK_NS)
    ahead_m = np.sqrt([pose.covariance[0, 0] for pose in found])
    assert (np.diff(ahead_m) > 0).all()
    assert ahead_m[80] == pytest.approx(0.01 * 200, rel=0.05)


def twists(model: OdometryModel, speed_mps: float = 10.0, radius_m: float = 25.0) -> PlanarTwist:
    for tick in range(3):
        state = state_at(circle(speed_mps, radius_m), tick)
        model.advance(state)
    return model.twist(state)


def test_without_errors_the_twist_is_that_of_the_ego_frame_ahead_of_the_axle() -> None:
    twist = twists(OdometryModel(odometry(**PERFECT), 1, TICK_NS, axle_m=AXLE_M))
    assert twist.forward_mps == pytest.approx(10.0, rel=1e-3)
    assert twist.yaw_rate_radps == pytest.approx(0.4, rel=1e-3)
    assert twist.left_mps == pytest.approx(0.4 * AXLE_M, rel=1e-3)


def test_at_the_rear_axle_nothing_moves_sideways() -> None:
    twist = twists(OdometryModel(odometry(), 1, TICK_NS, axle_m=AXLE_M, base_link_x_m=-AXLE_M))
    assert twist.left_mps == 0.0 and 0 < twist.covariance[1, 1] < 1e-3


def test_the_covariance_of_the_twist_fits_its_error_over_many_seeds() -> None:
    seeds = 400
    exact = twists(OdometryModel(odometry(**PERFECT), 0, TICK_NS, axle_m=AXLE_M))
    squares = np.zeros(seeds)
    for seed in range(seeds):
        found = twists(OdometryModel(odometry(), seed, TICK_NS, axle_m=AXLE_M))
        error = np.array([found.forward_mps - exact.forward_mps, found.yaw_rate_radps - exact.yaw_rate_radps])
        squares[seed] = error @ np.linalg.solve(found.covariance[np.ix_((0, 2), (0, 2))], error)
    low, high = chi2.ppf([0.0005, 0.9995], 2 * seeds) / seeds
    assert low < squares.mean() < high


def test_standing_wheels_report_no_motion() -> None:
    model = OdometryModel(odometry(), 1, TICK_NS, axle_m=AXLE_M)
    state = world(actor(CAR, x=4.0, yaw=1.0), tick=0)
    model.advance(state)
    twist = model.twist(state)
    assert (twist.forward_mps, twist.left_mps, twist.yaw_rate_radps) == (0, 0, 0)
    assert (np.diag(twist.covariance) > 0).all()


def test_values_depend_on_seed_and_tick_and_not_on_the_rate_of_the_messages() -> None:
    slow, fast = (OdometryModel(odometry(), 7, TICK_NS, period, axle_m=AXLE_M) for period in (5, 1))
    other = OdometryModel(odometry(), 8, TICK_NS, axle_m=AXLE_M)
    for tick in range(-1, 6):
        state = state_at(circle(10.0, 25.0), tick)
        for model in (slow, fast, other):
            model.advance(state)
    assert [tick for tick in range(-5, 11) if slow.is_due(tick)] == [0, 5, 10]
    assert (slow.pose.x_m, slow.twist(state).forward_mps) == (fast.pose.x_m, fast.twist(state).forward_mps)
    assert other.pose.x_m != fast.pose.x_m
