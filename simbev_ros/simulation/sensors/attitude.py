"""Errors of the orientation that an IMU with an attitude and heading reference gives. No ROS."""

import numpy as np

from simbev_ros.config.positioning import ImuOrientation
from simbev_ros.foundation.random import stream
from simbev_ros.foundation.types import Float64Array
from simbev_ros.simulation.sensors.processes import Drift

MIN_VARIANCE = 1e-12
"""Variance that an IMU reports for exact values, (m/s²)², (rad/s)² and rad²: zeros would mean "unknown"."""


class AttitudeErrors:
    """Small rotations about the axes of the map frame, by which a measured orientation is wrong, through one scene."""

    def __init__(self, name: str, orientation: ImuOrientation, seed: int, step_s: float) -> None:
        """Start at the first sample.

        Args:
            name: Name of the IMU, part of the names of its random streams.
            orientation: The configured errors.
            seed: Seed of the scene.
            step_s: Time between two samples.
        """
        self._name, self._seed = name, seed
        tilt_rad, heading_rad, noise_rad = np.radians(
            [orientation.tilt_drift_sigma_deg, orientation.heading_drift_sigma_deg, orientation.noise_sigma_deg]
        ).tolist()
        self._noise_rad = noise_rad
        self._tilt, self._heading = (
            Drift.gauss_markov(stream(seed, f"imu.{name}.{error}"), np.full(3, sigma_rad), time_s, step_s)
            for error, sigma_rad, time_s in (
                ("tilt", tilt_rad, orientation.tilt_drift_time_s),
                ("heading", heading_rad, orientation.heading_drift_time_s),
            )
        )
        variances = np.array([tilt_rad, tilt_rad, heading_rad]) ** 2 + noise_rad**2
        self.covariance = np.diag(np.maximum(variances, MIN_VARIANCE))
        """(3, 3) covariance of the errors, rad²."""

    def errors_until(self, tick: int, index: int, samples: int) -> Float64Array:
        """Errors of the samples of a tick; ticks must increase from call to call.

        Args:
            tick: The tick, which keys the white noise.
            index: Number of the tick's last sample.
            samples: Number S of samples in a tick.

        Returns:
            (K, 3) rotations about x, y and z, rad, of the last K ≤ S samples; K is 1 at the first tick.
        """
        tilt_rad = self._tilt.values_until(index, samples)
        heading_rad = self._heading.values_until(index, samples)
        noise = stream(self._seed, f"imu.{self._name}.orientation", tick).standard_normal((samples, 3))
        drift_rad = np.concatenate([tilt_rad[:, :2], heading_rad[:, 2:]], axis=1)
        return drift_rad + self._noise_rad * noise[-len(drift_rad) :]
