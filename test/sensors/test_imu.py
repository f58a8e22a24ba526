import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from synthetic_world import TICK_NS, actor, box_model, world

from simbev_ros.config.positioning import Imu
from simbev_ros.config.sensor import Pose
from simbev_ros.semantics import Tag
from simbev_ros.sensors.imu import GRAVITY_MPS2, ImuSample, measure_imu

CAR = box_model(Tag.CAR, (4.0, 2.0, 1.5))


def imu(**properties: object) -> Imu:
    silent = {"accelerometer_noise_sigma_mps2": 0, "gyroscope_noise_sigma_radps": 0, "gyroscope_bias_radps": 0}
    return Imu.model_validate({"type": "imu", "name": "imu"} | silent | properties)


def measured(pose: Pose | None = None, **ego: float) -> ImuSample:
    return measure_imu(imu(pose=pose or Pose()), world(actor(CAR, **ego)), None, seed=1)


def test_at_rest_and_level_it_reads_plus_g() -> None:
    sample = measured(yaw=1.0, x=5.0)
    assert sample.linear_acceleration_mps2 == pytest.approx([0, 0, 9.81])
    assert not sample.angular_velocity_radps.any()


def test_nose_down_it_reads_g_towards_the_rear() -> None:
    sample = measured(pitch=0.3, yaw=2.0)
    assert sample.linear_acceleration_mps2 == pytest.approx([-9.81 * math.sin(0.3), 0, 9.81 * math.cos(0.3)], abs=1e-5)


def test_leaning_left_side_up_it_reads_g_to_the_left() -> None:
    sample = measured(roll=0.2)
    assert sample.linear_acceleration_mps2 == pytest.approx([0, 9.81 * math.sin(0.2), 9.81 * math.cos(0.2)], abs=1e-5)


def test_on_a_left_hand_circle_it_reads_v2_over_r_to_the_left() -> None:
    speed_mps, radius_m, yaw = 10.0, 25.0, 0.7
    toward_center = yaw + math.pi / 2
    a = speed_mps**2 / radius_m
    sample = measured(yaw=yaw, ax=a * math.cos(toward_center), ay=a * math.sin(toward_center), wz=speed_mps / radius_m)
    assert sample.linear_acceleration_mps2 == pytest.approx([0, 4.0, 9.81], abs=1e-5)
    assert sample.angular_velocity_radps == pytest.approx([0, 0, 0.4])


def test_lever_arm_adds_centripetal_acceleration() -> None:
    sample = measured(Pose(x_m=2.0, y_m=0.5), yaw=1.1, wz=0.5)
    assert sample.linear_acceleration_mps2 == pytest.approx([-0.25 * 2.0, -0.25 * 0.5, GRAVITY_MPS2], abs=1e-6)


def test_lever_arm_adds_tangential_acceleration() -> None:
    before, now = world(actor(CAR, yaw=0.4, wz=0.1)), world(actor(CAR, yaw=0.4, wz=0.2), tick=1)
    assert now.stamp_ns - before.stamp_ns == TICK_NS
    sample = measure_imu(imu(pose=Pose(x_m=2.0)), now, before, seed=1)  # α = 0.1 / 0.05 s = 2 rad/s²
    assert sample.linear_acceleration_mps2 == pytest.approx([-0.04 * 2.0, 4.0, GRAVITY_MPS2], abs=1e-5)


def test_measurements_are_in_the_frame_of_the_turned_sensor() -> None:
    sample = measured(Pose(yaw_deg=90.0), ax=3.0, wx=0.25)
    assert sample.linear_acceleration_mps2 == pytest.approx([0, -3.0, GRAVITY_MPS2], abs=1e-6)
    assert sample.angular_velocity_radps == pytest.approx([0, -0.25, 0], abs=1e-7)


def test_orientation_is_that_of_the_sensor_in_the_map() -> None:
    sample = measured(Pose(yaw_deg=30.0, pitch_deg=10.0), roll=0.1, pitch=-0.2, yaw=2.5)
    ego = Rotation.from_euler("xyz", [0.1, -0.2, 2.5])
    expected = ego * Rotation.from_euler("xyz", [0.0, 10.0, 30.0], degrees=True)
    assert (Rotation.from_quat(sample.orientation_xyzw).inv() * expected).magnitude() < 1e-6


def test_noise_has_bias_and_sigma_as_configured_and_as_in_the_covariances() -> None:
    sensor = imu(accelerometer_noise_sigma_mps2=0.2, gyroscope_noise_sigma_radps=0.03, gyroscope_bias_radps=-0.1)
    samples = [measure_imu(sensor, world(actor(CAR), tick=tick), None, seed=1) for tick in range(4000)]
    force = np.array([sample.linear_acceleration_mps2 for sample in samples])
    rate = np.array([sample.angular_velocity_radps for sample in samples])
    assert force.mean(axis=0) == pytest.approx([0, 0, 9.81], abs=0.02)
    assert rate.mean(axis=0) == pytest.approx([-0.1] * 3, abs=0.003)
    assert np.cov(force.T) == pytest.approx(samples[0].linear_acceleration_covariance, abs=0.004)
    assert np.cov(rate.T) == pytest.approx(samples[0].angular_velocity_covariance, abs=1e-4)
    assert (samples[0].orientation_covariance.diagonal() > 0).all()
