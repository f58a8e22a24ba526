"""GNSS and IMU messages, compared with REP-145 and the message definitions."""

import math

import numpy as np
from geometry_msgs.msg import Quaternion
from sensor_msgs.msg import NavSatFix, NavSatStatus

from simbev_ros.config.positioning import Imu
from simbev_ros.config.rig import Rig
from simbev_ros.ros.msgs.motion import fix_message, imu_messages, velocity_messages
from simbev_ros.ros.msgs.qos import qos_of
from simbev_ros.ros.msgs.stamps import stamp_of
from simbev_ros.ros.msgs.topic import Topic
from simbev_ros.simulation.sensors.gnss import NO_FIX, GnssFix, GnssVelocitySample
from simbev_ros.simulation.sensors.imu import ImuSamples

SAMPLES = ImuSamples(
    stamps_ns=np.array([5_000_000_010, 5_000_000_020]),
    linear_acceleration_mps2=np.array([[0.1, 0.2, 9.8], [0.3, 0.4, 9.9]]),
    angular_velocity_radps=np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]),
    orientation_xyzw=np.array([[0.0, 0.0, 0.6, 0.8], [0.0, 0.0, 0.8, 0.6]]),
    linear_acceleration_covariance=np.eye(3) * 0.25,
    angular_velocity_covariance=np.eye(3) * 0.5,
    orientation_covariance=np.eye(3) * 1e-12,
)


def test_each_sample_is_a_message_with_its_own_stamp() -> None:
    first, second = imu_messages(SAMPLES, "ego/imu", oriented=True)
    assert [stamp_of(each.header.stamp) for each in (first, second)] == SAMPLES.stamps_ns.tolist()
    assert first.header.frame_id == "ego/imu"
    assert (second.linear_acceleration.y, second.angular_velocity.z, second.orientation.z) == (0.4, 6.0, 0.8)
    assert np.array_equal(first.linear_acceleration_covariance.reshape(3, 3), np.eye(3) * 0.25)
    assert np.array_equal(first.angular_velocity_covariance.reshape(3, 3), np.eye(3) * 0.5)
    assert np.array_equal(first.orientation_covariance.reshape(3, 3), np.eye(3) * 1e-12)


def test_raw_data_are_marked_as_without_orientation() -> None:
    for message in imu_messages(SAMPLES, "ego/imu", oriented=False):
        assert message.orientation_covariance[0] == -1.0
        assert message.orientation == Quaternion()


def test_a_fix_has_its_covariance() -> None:
    covariance_m2 = np.diag([1.0, 2.0, 3.0])
    message = fix_message(GnssFix(48.0, 11.0, 500.0, covariance_m2), 5_000_000_010, "ego/gnss")
    assert (message.latitude, message.longitude, message.altitude) == (48.0, 11.0, 500.0)
    assert message.status == NavSatStatus(status=NavSatStatus.STATUS_FIX, service=NavSatStatus.SERVICE_GPS)
    assert message.position_covariance_type == NavSatFix.COVARIANCE_TYPE_KNOWN
    assert np.array_equal(message.position_covariance.reshape(3, 3), covariance_m2)


def test_without_a_fix_position_is_nan_and_covariance_unknown() -> None:
    message = fix_message(NO_FIX, 5_000_000_010, "ego/gnss")
    assert all(math.isnan(value) for value in (message.latitude, message.longitude, message.altitude))
    assert message.status.status == NavSatStatus.STATUS_NO_FIX
    assert message.position_covariance_type == NavSatFix.COVARIANCE_TYPE_UNKNOWN
    assert not message.position_covariance.any()


def test_queues_hold_as_many_ticks_of_a_fast_imu_as_of_a_slow_one() -> None:
    slow = Topic("/a", "sensor_msgs/msg/Imu", sensor=True)
    fast = Topic("/a", "sensor_msgs/msg/Imu", sensor=True, messages_per_tick=5)
    for live in (False, True):
        assert qos_of(fast, live=live).depth == 5 * qos_of(slow, live=live).depth


def test_a_bias_is_one_value_or_one_per_axis() -> None:
    (imu,) = Rig.model_validate(
        {"sensors": [{"type": "imu", "name": "a", "gyroscope_bias_radps": 0.1, "accelerometer_bias_mps2": [1, 2, 3]}]}
    ).of_type(Imu)
    assert imu.gyroscope_bias_radps == (0.1, 0.1, 0.1) and imu.accelerometer_bias_mps2 == (1.0, 2.0, 3.0)
    assert Imu.model_validate(imu.model_dump(mode="json")) == imu


def test_a_velocity_has_the_axes_of_the_map_and_no_rotation() -> None:
    sample = GnssVelocitySample(np.array([1.0, -2.0, 0.5]), np.diag([0.01, 0.02, 0.04]))
    plain, full = velocity_messages(sample, 5_000_000_010)
    assert plain.header == full.header and full.header.frame_id == "map"
    assert stamp_of(full.header.stamp) == 5_000_000_010
    assert plain.twist == full.twist.twist
    assert (plain.twist.linear.x, plain.twist.linear.y, plain.twist.linear.z) == (1.0, -2.0, 0.5)
    covariance = full.twist.covariance.reshape(6, 6)
    assert np.array_equal(covariance[:3, :3], np.diag([0.01, 0.02, 0.04])) and covariance[3, 3] == -1


def test_without_a_fix_velocity_is_nan_and_its_covariance_unknown() -> None:
    plain, full = velocity_messages(GnssVelocitySample(np.full(3, np.nan), None), 5_000_000_010)
    assert math.isnan(plain.twist.linear.x) and full.twist.covariance[0] == -1
