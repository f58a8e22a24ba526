"""Serializes GNSS measurements as gps_msgs/GPSFix. Pure: imports no ROS."""

import math

import numpy as np

from simbev_ros.drawing.displays.messages import build, serialize, stamped
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.simulation.sensors.gnss import GnssFix, GnssVelocitySample

GPS_FIX = "gps_msgs/msg/GPSFix"

_GPS, _DOPPLER, _COVARIANCE_KNOWN = 1, 4, 3
_SIGMAS, _SIGMAS_2D = 1.959964, 2.447747
"""Half-widths that hold 95 % of a normal distribution: √χ² of one and two degrees of freedom."""


def serialize_gps_fix(
    fix: GnssFix, velocity: GnssVelocitySample | None, stamp_ns: int, frame: str, map_from_east_rad: float
) -> bytes:
    """GPSFix message of a fix and of a velocity of the same time.

    The altitude is above the ellipsoid, as in NavSatFix, and the time that of the stamp. NaN says that something is not
    known or measured: everything without a fix, motion without a velocity, and the orientation of the device.
    Dilutions of precision are 0, which the definition reserves for unknown values; there are no satellites.

    Args:
        fix: The fix.
        velocity: The velocity; None: the receiver measures none.
        stamp_ns: Stamp of the header.
        frame: Frame of the antenna.
        map_from_east_rad: Direction of map x, counterclockwise from east.
    """
    header = stamped(stamp_ns, frame)
    has_motion = velocity is not None and velocity.covariance is not None
    status = build(
        "gps_msgs/msg/GPSStatus",
        header=header,
        status=-1 if fix.covariance_m2 is None else 0,
        position_source=0 if fix.covariance_m2 is None else _GPS,
        motion_source=_DOPPLER if has_motion else 0,
    )
    unknown = ("pitch", "roll", "dip", "err_time", "err_pitch", "err_roll", "err_dip")
    fields = {
        **dict.fromkeys(unknown, math.nan),
        **_position_fields(fix.covariance_m2),
        **_motion_fields(velocity, map_from_east_rad),
    }
    position = {"latitude": fix.latitude_deg, "longitude": fix.longitude_deg, "altitude": fix.altitude_m}
    return serialize(build(GPS_FIX, header=header, status=status, time=stamp_ns / NS_PER_S, **position, **fields))


def _position_fields(covariance_m2: np.ndarray | None) -> dict[str, object]:
    """Uncertainty of a position; the radius of the sphere is that of its circle and its height together, as in gpsd."""
    if covariance_m2 is None:
        return dict.fromkeys(("err", "err_horz", "err_vert"), math.nan)
    east_m2, north_m2, up_m2 = np.diag(covariance_m2).tolist()
    horizontal_m = _SIGMAS_2D * math.sqrt((east_m2 + north_m2) / 2.0)
    vertical_m = _SIGMAS * math.sqrt(up_m2)
    return {
        "err": math.hypot(horizontal_m, vertical_m),
        "err_horz": horizontal_m,
        "err_vert": vertical_m,
        "position_covariance": covariance_m2.ravel(),
        "position_covariance_type": _COVARIANCE_KNOWN,
    }


def _motion_fields(sample: GnssVelocitySample | None, map_from_east_rad: float) -> dict[str, float]:
    """Speed, course and climb with their uncertainty."""
    if sample is None or sample.covariance is None:
        names = "track", "speed", "climb", "err_track", "err_speed", "err_climb"
        return dict.fromkeys(names, math.nan)
    x, y, climb_mps = sample.velocity_mps.tolist()
    speed_mps, horizontal_mps = math.hypot(x, y), _SIGMAS * math.sqrt(sample.covariance[0, 0])
    return {
        "track": (90.0 - math.degrees(math.atan2(y, x) + map_from_east_rad)) % 360.0,
        "speed": speed_mps,
        "climb": climb_mps,
        "err_track": math.degrees(min(horizontal_mps / speed_mps if speed_mps else math.pi, math.pi)),
        "err_speed": horizontal_mps,
        "err_climb": _SIGMAS * math.sqrt(sample.covariance[2, 2]),
    }
