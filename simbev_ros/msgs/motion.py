"""GNSS fixes and IMU samples → messages."""

from sensor_msgs.msg import Imu, NavSatFix, NavSatStatus

from simbev_ros.msgs.stamps import header
from simbev_ros.msgs.world import quaternion_message, vector_message
from simbev_ros.sensors.gnss import GnssFix
from simbev_ros.sensors.imu import ImuSample


def fix_message(fix: GnssFix, stamp_ns: int, frame: str) -> NavSatFix:
    """NavSatFix with the covariance of its noise, known in full."""
    return NavSatFix(
        header=header(stamp_ns, frame),
        status=NavSatStatus(status=NavSatStatus.STATUS_FIX, service=NavSatStatus.SERVICE_GPS),
        latitude=fix.latitude_deg,
        longitude=fix.longitude_deg,
        altitude=fix.altitude_m,
        position_covariance=fix.covariance_m2.ravel().tolist(),
        position_covariance_type=NavSatFix.COVARIANCE_TYPE_DIAGONAL_KNOWN,
    )


def imu_message(sample: ImuSample, stamp_ns: int, frame: str, *, oriented: bool) -> Imu:
    """Imu; without orientation its covariance begins with -1, as the message's definition asks."""
    message = Imu(
        header=header(stamp_ns, frame),
        angular_velocity=vector_message(sample.angular_velocity_radps),
        angular_velocity_covariance=sample.angular_velocity_covariance.ravel().tolist(),
        linear_acceleration=vector_message(sample.linear_acceleration_mps2),
        linear_acceleration_covariance=sample.linear_acceleration_covariance.ravel().tolist(),
        orientation_covariance=[-1.0] + [0.0] * 8,
    )
    if oriented:
        message.orientation = quaternion_message(sample.orientation_xyzw)
        message.orientation_covariance = sample.orientation_covariance.ravel().tolist()
    return message
