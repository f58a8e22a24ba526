"""A filter that trusts the covariances of wheel odometry, IMU and GNSS knows how wrong it is.

The filter is an extended Kalman filter of its own, with the constant errors of the odometry and the drift of the
heading as states. What remains of the published covariances without these is the white noise of each message.
"""

import math
from functools import cache
from typing import NamedTuple

import numpy as np
import pytest
from analytic_motion import TICK_S, state_at
from scipy.spatial.transform import Rotation
from scipy.stats import chi2
from synthetic_world import TICK_NS

from simbev_ros.config.odometry import Odometry
from simbev_ros.config.positioning import Gnss, Imu, ImuOrientation
from simbev_ros.foundation.geometry.geodesy import MapDatum
from simbev_ros.foundation.random import stream
from simbev_ros.foundation.types import Float64Array
from simbev_ros.simulation.sensors.gnss import GnssModel
from simbev_ros.simulation.sensors.imu import ImuModel
from simbev_ros.simulation.sensors.odometry import OdometryModel, PlanarTwist

TICKS, SEEDS, GNSS_PERIOD, CHECKED = 240, 12, 10, (60, 150, 239)
pytestmark = pytest.mark.slow

DATUM = MapDatum(latitude_deg=48.0, longitude_deg=11.0, altitude_m=500.0)
ODOMETRY = Odometry(type="odometry", name="wheel")
IMU = Imu(type="imu", name="imu", orientation=ImuOrientation())
GNSS = Gnss.model_validate({"type": "gnss", "name": "gnss", "velocity": {}, "latitude_noise_sigma_deg": 3e-6,
                            "longitude_noise_sigma_deg": 5e-6})  # fmt: skip
START = np.array([0.5, 0.5, 0.05])
"""Standard deviations of the first estimate of x, y and heading."""


def winding(time_s: float) -> tuple[Float64Array, Float64Array]:
    """Level road; the rear axle is the origin of the ego frame, so the car heads along the path."""
    heading = math.atan2(4 * math.cos(0.2 * time_s), 8.0)
    return np.array([8 * time_s, 20 * math.sin(0.2 * time_s), 0.0]), np.array([0.0, 0.0, heading])


STATES = [state_at(winding, tick) for tick in range(TICKS)]


class Filter:
    """x, y, heading; relative errors of speed and yaw rate; bias of the yaw rate; drift of the IMU's heading."""

    def __init__(self, estimate: Float64Array, *, knows_biases: bool) -> None:
        orientation = IMU.orientation
        assert orientation is not None
        drift_rad = math.radians(orientation.heading_drift_sigma_deg)
        biases = [
            ODOMETRY.speed_scale_sigma,
            ODOMETRY.yaw_rate_scale_sigma,
            ODOMETRY.yaw_rate_bias_sigma_radps,
            drift_rad,
        ]
        self.biases = np.array(biases if knows_biases else [0.0] * 4) ** 2
        self.state = np.array([*estimate, 0.0, 0.0, 0.0, 0.0])
        self.covariance = np.diag([*np.square(START), *self.biases])
        self.decay = math.exp(-TICK_S / orientation.heading_drift_time_s)

    def predict(self, speed_mps: float, rate_radps: float, variances: Float64Array) -> None:
        """Move by measured speed and yaw rate, which have (2,) variances of white noise."""
        _, _, heading, speed_scale, rate_scale, bias, _ = self.state
        true_mps = speed_mps / (1 + speed_scale)
        true_radps = (rate_radps - bias) / (1 + rate_scale)
        middle = heading + true_radps * TICK_S / 2
        ahead = np.array([math.cos(middle), math.sin(middle)])
        step, inputs = np.eye(7), np.zeros((7, 2))
        step[:2, 2] = true_mps * TICK_S * np.array([-ahead[1], ahead[0]])
        inputs[:2, 0], inputs[2, 1] = ahead * TICK_S, TICK_S
        inputs[:2, 1] = step[:2, 2] * TICK_S / 2
        step[:3, 3] = -true_mps * inputs[:3, 0]
        step[:3, 4], step[:3, 5] = -true_radps * inputs[:3, 1], -inputs[:3, 1]
        step[6, 6] = self.decay
        self.state[:3] += [*(true_mps * TICK_S * ahead), true_radps * TICK_S]
        self.state[6] *= self.decay
        self.covariance = step @ self.covariance @ step.T + inputs @ np.diag(variances) @ inputs.T
        self.covariance[5, 5] += ODOMETRY.yaw_rate_bias_walk_radps_per_sqrt_s**2 * TICK_S
        self.covariance[6, 6] += self.biases[3] * (1 - self.decay**2)

    def update(self, residual: Float64Array, by_state: Float64Array, covariance: Float64Array) -> None:
        """Take a measurement by its residual, its derivative and its noise."""
        gain = self.covariance @ by_state.T @ np.linalg.inv(by_state @ self.covariance @ by_state.T + covariance)
        self.state += gain @ residual
        keep = np.eye(7) - gain @ by_state
        self.covariance = keep @ self.covariance @ keep.T + gain @ covariance @ gain.T


def wrap(angle: float) -> float:
    return math.remainder(angle, 2 * math.pi)


class Measured(NamedTuple):
    """What the sensors say at a tick: the twist; the heading and its variance; and position and covariance of a fix."""

    twist: PlanarTwist
    heading_rad: float
    heading_variance: Float64Array
    fix: tuple[Float64Array, Float64Array] | None


@cache
def measured(seed: int) -> list[Measured]:
    """Measurements at all ticks."""
    wheel = OdometryModel(ODOMETRY, seed, TICK_NS, axle_m=0.0)
    imu, gnss = ImuModel(IMU, seed, TICK_NS), GnssModel(GNSS, DATUM, seed, TICK_NS)
    found = []
    for tick, state in enumerate(STATES):
        wheel.advance(state)
        samples = imu.measure(state, STATES[tick - 1] if tick else None)
        heading_rad = Rotation.from_quat(samples.orientation_xyzw[-1]).as_euler("xyz")[2]
        position = None
        if tick % GNSS_PERIOD == 0:
            fix = gnss.measure(state)
            assert fix.covariance_m2 is not None
            measured_m = DATUM.map_from_geodetic(fix.latitude_deg, fix.longitude_deg, fix.altitude_m)[:2]
            position = np.asarray(measured_m), fix.covariance_m2[:2, :2]
        found.append(Measured(wheel.twist(state), heading_rad, samples.orientation_covariance[2:, 2:], position))
    return found


def localize(seed: int, *, knows_biases: bool = True) -> list[tuple[Float64Array, Float64Array]]:
    """(3,) errors and (3, 3) covariances of x, y and heading at the checked ticks."""
    first = np.array([*winding(0)[0][:2], winding(0)[1][2]])
    found = Filter(first + START * stream(seed, "start").standard_normal(3), knows_biases=knows_biases)
    results, before = [], (0.0, 0.0)
    for tick, (twist, heading_rad, heading_variance, fix) in enumerate(measured(seed)):
        if tick:
            speed_variance = twist.covariance[0, 0] - (found.biases[0] * twist.forward_mps**2)
            rate_variance = twist.covariance[2, 2] - found.biases[1] * twist.yaw_rate_radps**2 - found.biases[2]
            mean_mps, mean_radps = (twist.forward_mps + before[0]) / 2, (twist.yaw_rate_radps + before[1]) / 2
            # The mean of two messages has half of their noise, but neighbors share one of them: in sum, all of it.
            found.predict(mean_mps, mean_radps, np.array([speed_variance, rate_variance]))
        before = twist.forward_mps, twist.yaw_rate_radps
        by_state = np.array([[0.0, 0, 1, 0, 0, 0, 1]])
        noise = heading_variance - found.biases[3]
        found.update(np.array([wrap(heading_rad - found.state[2] - found.state[6])]), by_state, noise)
        if fix is not None:
            found.update(fix[0] - found.state[:2], np.eye(2, 7), fix[1])
        if tick in CHECKED:
            position_m, rpy_rad = winding(tick * TICK_S)
            error = found.state[:3] - [*position_m[:2], rpy_rad[2]]
            results.append((np.array([*error[:2], wrap(error[2])]), found.covariance[:3, :3]))
    return results


def mean_squares(*, knows_biases: bool) -> Float64Array:
    """Normalized error squared at each checked tick, averaged over all seeds; 3 if the filter is consistent."""
    runs = [localize(seed, knows_biases=knows_biases) for seed in range(SEEDS)]
    return np.mean([[error @ np.linalg.solve(covariance, error) for error, covariance in run] for run in runs], axis=0)


BOUNDS = chi2.ppf([0.0005, 0.9995], 3 * SEEDS) / SEEDS


def test_with_the_published_covariances_the_filter_is_consistent() -> None:
    squares = mean_squares(knows_biases=True)
    assert ((BOUNDS[0] < squares) & (squares < BOUNDS[1])).all(), squares


def test_a_filter_that_takes_biases_for_white_noise_is_too_sure_of_itself() -> None:
    assert mean_squares(knows_biases=False)[-1] > BOUNDS[1]


def test_together_the_sensors_are_better_than_gnss_and_imu_alone() -> None:
    _, covariance = localize(1)[-1]
    sigma = np.sqrt(np.diag(covariance))
    fix = GnssModel(GNSS, DATUM, 1, TICK_NS).measure(STATES[0])
    assert fix.covariance_m2 is not None
    assert (sigma[:2] < np.sqrt(np.diag(fix.covariance_m2)[:2])).all() and sigma[2] < math.radians(1.5)
