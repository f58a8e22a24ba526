import math
from itertools import pairwise

import numpy as np
import pytest
from analytic_motion import CAR, TICK_S, Path, circle, rolling, screw, state_at, straight
from scipy.spatial.transform import Rotation
from synthetic_world import TICK_NS, actor, world

from simbev_ros.config.positioning import Imu
from simbev_ros.config.sensor import Pose
from simbev_ros.foundation.units import GRAVITY_MPS2
from simbev_ros.simulation.sensors.imu import ImuModel, ImuSamples

SILENT = {"accelerometer_noise_sigma_mps2": 0, "gyroscope_noise_sigma_radps": 0, "gyroscope_bias_radps": 0}


def imu(**properties: object) -> Imu:
    return Imu.model_validate({"type": "imu", "name": "imu"} | SILENT | properties)


def measure_once(pose: Pose | None = None, **ego: float) -> ImuSamples:
    """Samples at one tick, without a previous state."""
    return ImuModel(imu(pose=pose or Pose()), 1, TICK_NS).measure(world(actor(CAR, **ego)), None)


def measure_on_path(path: Path, pose: Pose, samples: int = 5) -> tuple[ImuSamples, np.ndarray]:
    """The samples of tick 7 of a path, and their times."""
    model = ImuModel(imu(pose=pose), 1, TICK_NS, samples=samples)
    return model.measure(state_at(path, 7), state_at(path, 6)), np.arange(-samples + 1, 1) / samples * TICK_S + 0.35


def test_at_rest_and_level_it_reads_plus_g() -> None:
    sample = measure_once(yaw=1.0, x=5.0)
    assert sample.linear_acceleration_mps2 == pytest.approx(np.array([[0, 0, 9.81]]))
    assert not sample.angular_velocity_radps.any()


def test_nose_down_it_reads_g_towards_the_rear() -> None:
    sample = measure_once(pitch=0.3, yaw=2.0)
    expected = [-9.81 * math.sin(0.3), 0, 9.81 * math.cos(0.3)]
    assert sample.linear_acceleration_mps2[0] == pytest.approx(expected, abs=1e-5)


def test_leaning_left_side_up_it_reads_g_to_the_left() -> None:
    sample = measure_once(roll=0.2)
    expected = [0, 9.81 * math.sin(0.2), 9.81 * math.cos(0.2)]
    assert sample.linear_acceleration_mps2[0] == pytest.approx(expected, abs=1e-5)


def test_on_a_left_hand_circle_it_reads_v2_over_r_to_the_left_at_any_moment() -> None:
    samples, _ = measure_on_path(circle(10.0, 25.0), Pose())
    assert samples.linear_acceleration_mps2 == pytest.approx(np.tile([0, 4.0, 9.81], (5, 1)), abs=2e-3)
    assert samples.angular_velocity_radps == pytest.approx(np.tile([0, 0, 0.4], (5, 1)), abs=1e-4)


def test_a_sensor_off_the_origin_moves_on_its_own_circle() -> None:
    samples, _ = measure_on_path(
        circle(10.0, 25.0), Pose(x_m=2.0, y_m=5.0, z_m=1.0)
    )  # 20 m from the center and 2 m ahead
    assert samples.linear_acceleration_mps2 == pytest.approx(np.tile([-0.32, 3.2, 9.81], (5, 1)), abs=2e-3)


def test_without_a_previous_state_the_lever_arm_reads_the_centripetal_acceleration() -> None:
    sample = measure_once(Pose(x_m=2.0, y_m=0.5), yaw=1.1, wz=0.5)
    assert sample.linear_acceleration_mps2[0] == pytest.approx([-0.25 * 2.0, -0.25 * 0.5, GRAVITY_MPS2], abs=1e-4)


def test_a_growing_spin_accelerates_the_lever_arm_sideways() -> None:
    samples, times_s = measure_on_path(lambda t: (np.zeros(3), np.array([0.0, 0.0, t**2])), Pose(x_m=2.0))  # 2 rad/s²
    expected = np.stack([-((2 * times_s) ** 2) * 2.0, np.full(5, 4.0), np.full(5, GRAVITY_MPS2)], axis=1)
    assert samples.linear_acceleration_mps2 == pytest.approx(expected, abs=0.015)


def test_speeding_up_it_reads_the_acceleration_ahead() -> None:
    samples, _ = measure_on_path(straight(20.0, 3.0, 2.5), Pose(x_m=1.0))
    assert samples.linear_acceleration_mps2 == pytest.approx(np.tile([3.0, 0, 9.81], (5, 1)), abs=1e-5)


def test_a_turned_sensor_measures_along_its_own_axes() -> None:
    samples, _ = measure_on_path(straight(20.0, 3.0, 2.5), Pose(yaw_deg=90.0))
    assert samples.linear_acceleration_mps2 == pytest.approx(np.tile([0, -3.0, 9.81], (5, 1)), abs=1e-5)
    samples, _ = measure_on_path(rolling(0.25), Pose(yaw_deg=90.0))
    assert samples.angular_velocity_radps == pytest.approx(np.tile([0, -0.25, 0], (5, 1)), abs=1e-5)


def test_a_screw_motion_is_measured_as_worked_out_by_hand() -> None:
    spin, roll, pitch = 0.8, 0.15, -0.2
    pose = Pose(x_m=1.5, y_m=-0.5, z_m=1.0, roll_deg=20, pitch_deg=-35, yaw_deg=130)
    samples, times_s = measure_on_path(screw(spin, 3.0, roll, pitch), pose)
    tilted = Rotation.from_euler("xyz", [roll, pitch, 0.0])
    sensor = tilted * Rotation.from_euler("xyz", [20, -35, 130], degrees=True)
    toward_axis = tilted.apply([1.5, -0.5, 1.0]) * [
        -(spin**2),
        -(spin**2),
        0.0,
    ]  # the sensor circles about the vertical
    force = sensor.inv().apply(toward_axis + np.array([0, 0, 9.81]))
    assert samples.linear_acceleration_mps2 == pytest.approx(np.tile(force, (5, 1)), abs=1e-3)
    assert samples.angular_velocity_radps == pytest.approx(np.tile(sensor.inv().apply([0, 0, spin]), (5, 1)), abs=1e-4)
    turned = Rotation.from_rotvec(np.outer(spin * times_s, [0, 0, 1])) * sensor
    assert (Rotation.from_quat(samples.orientation_xyzw).inv() * turned).magnitude().max() < 1e-6


def test_orientation_at_the_tick_is_that_of_the_sensor_in_the_map() -> None:
    sample = measure_once(Pose(yaw_deg=30.0, pitch_deg=10.0), roll=0.1, pitch=-0.2, yaw=2.5)
    ego = Rotation.from_euler("xyz", [0.1, -0.2, 2.5])
    expected = ego * Rotation.from_euler("xyz", [0.0, 10.0, 30.0], degrees=True)
    assert (Rotation.from_quat(sample.orientation_xyzw[0]).inv() * expected).magnitude() < 1e-6


def test_stamps_are_at_equal_distances_and_begin_with_tick_0() -> None:
    model = ImuModel(imu(), 1, TICK_NS, samples=7)
    states = [state_at(straight(5.0, 0.0, 0.0), tick) for tick in range(-1, 3)]
    stamps = [model.measure(now, before).stamps_ns for before, now in pairwise(states)]
    assert [len(each) for each in stamps] == [1, 7, 7]
    assert np.concatenate(stamps).tolist() == [TICK_NS * n // 7 for n in range(15)]


def test_a_previous_state_older_than_one_tick_is_ignored() -> None:
    path = straight(20.0, 3.0, 2.5)
    model, again = ImuModel(imu(), 1, TICK_NS, samples=4), ImuModel(imu(), 1, TICK_NS, samples=4)
    late, alone = model.measure(state_at(path, 9), state_at(path, 4)), again.measure(state_at(path, 9), None)
    assert np.array_equal(late.linear_acceleration_mps2, alone.linear_acceleration_mps2)


def errors(sensor: Imu, ticks: range, samples: int = 1, step: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """(N, 3) errors of specific force and of angular rate, for an ego at rest."""
    model = ImuModel(sensor, 1, TICK_NS, samples=samples)
    rest = [model.measure(world(actor(CAR), tick=tick), None) for tick in ticks[::step]]
    force = np.concatenate([each.linear_acceleration_mps2 for each in rest]) - [0, 0, GRAVITY_MPS2]
    return force, np.concatenate([each.angular_velocity_radps for each in rest])


def test_noise_has_bias_and_sigma_as_configured_and_as_in_the_covariances() -> None:
    sensor = imu(
        accelerometer_noise_sigma_mps2=0.2,
        gyroscope_noise_sigma_radps=0.03,
        accelerometer_bias_mps2=[0.5, 0.0, -0.5],
        gyroscope_bias_radps=-0.1,
    )
    force, rate = errors(sensor, range(1000), samples=5)
    assert force.mean(axis=0) == pytest.approx([0.5, 0, -0.5], abs=0.01)
    assert rate.mean(axis=0) == pytest.approx([-0.1] * 3, abs=0.002)
    sample = ImuModel(sensor, 1, TICK_NS).measure(world(actor(CAR)), None)
    assert np.cov(force.T) == pytest.approx(sample.linear_acceleration_covariance, abs=0.003)
    assert np.cov(rate.T) == pytest.approx(sample.angular_velocity_covariance, abs=7e-5)


def test_without_noise_covariances_are_positive_because_zero_would_mean_unknown() -> None:
    sample = measure_once()
    for covariance in (
        sample.linear_acceleration_covariance,
        sample.angular_velocity_covariance,
        sample.orientation_covariance,
    ):
        assert 0 < covariance[0, 0] < 1e-10


def test_every_sample_of_a_tick_has_its_own_noise() -> None:
    sensor = imu(accelerometer_noise_sigma_mps2=0.2)
    force, _ = errors(sensor, range(200), samples=5)
    assert len(np.unique(force)) == force.size
    assert abs(np.corrcoef(force[:-1, 0], force[1:, 0])[0, 1]) < 0.1


@pytest.mark.parametrize("samples", [1, 5])
def test_a_bias_walk_grows_with_the_square_root_of_time_at_any_rate(samples: int) -> None:
    ends = []
    for seed in range(150):
        model = ImuModel(
            imu(accelerometer_bias_walk_mps2_per_sqrt_s=0.3, gyroscope_bias_walk_radps_per_sqrt_s=0.02),
            seed,
            TICK_NS,
            samples=samples,
        )
        first = model.measure(world(actor(CAR), tick=0), None)
        assert not first.angular_velocity_radps.any()
        last = model.measure(world(actor(CAR), tick=80), None)  # 4 s
        ends.append([last.linear_acceleration_mps2[-1] - [0, 0, GRAVITY_MPS2], last.angular_velocity_radps[-1]])
    assert np.std(ends, axis=(0, 2)) == pytest.approx([0.6, 0.04], rel=0.1)


def test_a_bias_walk_continues_over_ticks_that_were_dropped() -> None:
    sensor = imu(gyroscope_bias_walk_radps_per_sqrt_s=0.02, accelerometer_bias_walk_mps2_per_sqrt_s=0.1)
    whole, thinned = errors(sensor, range(1, 90), samples=5), errors(sensor, range(1, 90), samples=5, step=11)
    for all_values, some in zip(whole, thinned, strict=True):
        assert np.array_equal(all_values.reshape(-1, 5, 3)[::11].reshape(-1, 3), some)


def test_on_a_turned_map_the_orientation_is_relative_to_east() -> None:
    for turned_rad in (0.0, 0.7):
        model = ImuModel(imu(), 1, TICK_NS, map_from_east_rad=turned_rad)
        sample = model.measure(world(actor(CAR, yaw=0.4)), None)
        yaw_rad = Rotation.from_quat(sample.orientation_xyzw[0]).as_euler("ZYX")[0]
        assert yaw_rad == pytest.approx(0.4 + turned_rad)


def test_the_orientation_keeps_its_sign_where_the_heading_passes_180_degrees() -> None:
    model = ImuModel(imu(), 1, TICK_NS)
    states = [state_at(circle(3.0, 10.0), tick) for tick in range(400)]
    measured = [model.measure(*pair) for pair in zip(states, [None, *states[:-1]], strict=True)]
    xyzw = np.concatenate([each.orientation_xyzw for each in measured])
    assert xyzw[0, 3] >= 0.0 and xyzw[:, 3].min() < -0.5
    assert np.abs(np.diff(xyzw, axis=0)).max() < 0.05
