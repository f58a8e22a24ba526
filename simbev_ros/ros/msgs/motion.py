"""Converts GNSS fixes and IMU samples to ROS messages."""

from collections.abc import Iterator

import numpy as np
from geometry_msgs.msg import TwistStamped, TwistWithCovarianceStamped
from sensor_msgs.msg import Imu, NavSatFix, NavSatStatus

from simbev_ros.ros.msgs.stamps import header
from simbev_ros.ros.msgs.world import MAP_FRAME, quaternion_message, vector_message
from simbev_ros.simulation.sensors.gnss import GnssFix, GnssVelocitySample
from simbev_ros.simulation.sensors.imu import ImuSamples


def fix_message(fix: GnssFix, stamp_ns: int, frame: str) -> NavSatFix:
    """NavSatFix message with the covariance of the fix.

    Without a fix, the position is NaN and its covariance unknown, as GNSS drivers publish it.
    """
    message = NavSatFix(
        header=header(stamp_ns, frame),
        status=NavSatStatus(status=NavSatStatus.STATUS_NO_FIX, service=NavSatStatus.SERVICE_GPS),
        latitude=fix.latitude_deg,
        longitude=fix.longitude_deg,
        altitude=fix.altitude_m,
        position_covariance_type=NavSatFix.COVARIANCE_TYPE_UNKNOWN,
    )
    if fix.covariance_m2 is not None:
        message.status.status = NavSatStatus.STATUS_FIX
        message.position_covariance = fix.covariance_m2.ravel().tolist()
        message.position_covariance_type = NavSatFix.COVARIANCE_TYPE_KNOWN
    return message


def velocity_messages(sample: GnssVelocitySample, stamp_ns: int) -> tuple[TwistStamped, TwistWithCovarianceStamped]:
    """A GNSS velocity without and with its covariance.

    Velocities are along the axes of the map frame, so that is their frame; drivers name that of the antenna, although
    their velocities are east, north and up. Without a fix the velocity is NaN. Rotation is not measured: its
    covariance starts with -1, as ublox_gps publishes it, and so does that of a velocity without a fix.
    """
    with_covariance = TwistWithCovarianceStamped(header=header(stamp_ns, MAP_FRAME))
    with_covariance.twist.twist.linear = vector_message(sample.velocity_mps)
    covariance = np.zeros((6, 6))
    covariance[3, 3] = -1.0
    if sample.covariance is None:
        covariance[0, 0] = -1.0
    else:
        covariance[:3, :3] = sample.covariance
    with_covariance.twist.covariance = covariance.ravel().tolist()
    return TwistStamped(header=with_covariance.header, twist=with_covariance.twist.twist), with_covariance


def imu_messages(samples: ImuSamples, frame: str, *, oriented: bool) -> Iterator[Imu]:
    """Imu messages, one per sample.

    Without orientation, its covariance starts with -1, as the message definition requires.
    """
    rate_covariance = samples.angular_velocity_covariance.ravel().tolist()
    force_covariance = samples.linear_acceleration_covariance.ravel().tolist()
    orientation_covariance = samples.orientation_covariance.ravel().tolist() if oriented else [-1.0] + [0.0] * 8
    for row, stamp_ns in enumerate(samples.stamps_ns.tolist()):
        message = Imu(
            header=header(stamp_ns, frame),
            angular_velocity=vector_message(samples.angular_velocity_radps[row]),
            angular_velocity_covariance=rate_covariance,
            linear_acceleration=vector_message(samples.linear_acceleration_mps2[row]),
            linear_acceleration_covariance=force_covariance,
            orientation_covariance=orientation_covariance,
        )
        if oriented:
            message.orientation = quaternion_message(samples.orientation_xyzw[row])
        yield message
