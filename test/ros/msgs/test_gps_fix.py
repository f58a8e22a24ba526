"""gps_msgs/GPSFix against its definition: what is known at 95 %, and NaN or 0 for everything else."""

import math
from typing import Any

import numpy as np
import pytest

from simbev_ros.ros.msgs.gps_fix import GPS_FIX, serialize_gps_fix
from simbev_ros.schema.messages.message_types import types_with
from simbev_ros.simulation.sensors.gnss import NO_FIX, GnssFix, GnssVelocitySample

FIX = GnssFix(48.0, 11.0, 500.0, np.diag([1.0, 4.0, 9.0]))
NO_ORIENTATION = ("pitch", "roll", "dip", "err_pitch", "err_roll", "err_dip", "err_time")
MOTION = ("track", "speed", "climb", "err_track", "err_speed", "err_climb")
POSITION = ("latitude", "longitude", "altitude", "err", "err_horz", "err_vert")


def moving(*velocity_mps: float) -> GnssVelocitySample:
    return GnssVelocitySample(np.array(velocity_mps), np.diag([0.01, 0.01, 0.04]))


def message_of(fix: GnssFix, velocity: GnssVelocitySample | None, map_from_east_rad: float = 0.0) -> Any:
    data = serialize_gps_fix(fix, velocity, 5_500_000_000, "ego/gnss", map_from_east_rad)
    return types_with(GPS_FIX).deserialize_cdr(data, GPS_FIX)


def unknown_in(message: Any) -> set[str]:
    return {name for name in vars(message) if isinstance(value := getattr(message, name), float) and math.isnan(value)}


def test_a_fix_with_a_velocity_says_all_but_the_orientation() -> None:
    message = message_of(FIX, moving(3.0, -4.0, 0.5))
    assert unknown_in(message) == {*NO_ORIENTATION}
    assert (message.latitude, message.longitude, message.altitude, message.time) == (48.0, 11.0, 500.0, 5.5)
    assert message.header == message.status.header and message.header.frame_id == "ego/gnss"
    assert (message.status.status, message.status.position_source, message.status.motion_source) == (0, 1, 4)
    assert (message.speed, message.climb, message.hdop) == (5.0, 0.5, 0.0)
    assert message.position_covariance_type == 3
    assert np.array_equal(message.position_covariance.reshape(3, 3), FIX.covariance_m2)


def test_errors_hold_95_percent_of_the_samples() -> None:
    message = message_of(GnssFix(48.0, 11.0, 500.0, np.diag([4.0, 4.0, 9.0])), moving(8.0, 6.0, 0.0))
    noise = np.random.default_rng(1).standard_normal((100_000, 3)) * [2.0, 2.0, 3.0]
    assert np.mean(np.hypot(*noise.T[:2]) < message.err_horz) == pytest.approx(0.95, abs=0.003)
    assert np.mean(np.abs(noise[:, 2]) < message.err_vert) == pytest.approx(0.95, abs=0.003)
    assert 0.95 < np.mean(np.linalg.norm(noise, axis=1) < message.err) < 0.99
    east, north = (np.random.default_rng(2).standard_normal((100_000, 2)) * 0.1 + [8.0, 6.0]).T
    off_deg = np.degrees(np.arctan2(east, north)) - message.track
    assert np.mean(np.abs(off_deg) < message.err_track) == pytest.approx(0.95, abs=0.003)
    assert message.err_speed == pytest.approx(0.196, abs=1e-4) and message.err_climb == pytest.approx(0.392, abs=1e-4)


@pytest.mark.parametrize(
    ("velocity", "turned_deg", "track_deg"),
    [((0, 1, 0), 0, 0), ((1, 0, 0), 0, 90), ((0, -1, 0), 0, 180), ((-1, 0, 0), 0, 270), ((1, 0, 0), 30, 60)],
)
def test_tracks_are_clockwise_from_north(velocity: tuple[float, ...], turned_deg: float, track_deg: float) -> None:
    message = message_of(FIX, moving(*velocity), math.radians(turned_deg))
    assert message.track == pytest.approx(track_deg, abs=1e-9)


def test_the_track_of_an_antenna_that_stands_may_be_any() -> None:
    assert message_of(FIX, moving(0.0, 0.0, 0.0)).err_track == 180.0


def test_without_a_velocity_there_is_no_motion() -> None:
    message = message_of(FIX, None)
    assert unknown_in(message) == {*NO_ORIENTATION, *MOTION} and message.status.motion_source == 0


def test_without_a_fix_nothing_is_known() -> None:
    message = message_of(NO_FIX, GnssVelocitySample(np.full(3, np.nan), None))
    assert unknown_in(message) == {*NO_ORIENTATION, *MOTION, *POSITION}
    assert (message.status.status, message.status.position_source, message.status.motion_source) == (-1, 0, 0)
    assert message.position_covariance_type == 0 and not message.position_covariance.any()
