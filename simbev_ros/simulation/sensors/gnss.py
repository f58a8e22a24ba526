"""GNSS receiver model: turns the world state at a tick into a WGS84 position and a velocity with errors and drop-outs.

In a tunnel there is no fix, from the portal on. No ROS.
"""

import math
from dataclasses import dataclass

import numpy as np

from simbev_ros.config.positioning import Gnss
from simbev_ros.foundation.geometry.geodesy import MapDatum
from simbev_ros.foundation.random import stream
from simbev_ros.foundation.types import Float64Array
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.maps.roads.tunnels import Tunnels
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.simulation.sensors.mount import map_from_sensor, vector
from simbev_ros.simulation.sensors.processes import Drift, Outages

_MIN_VARIANCE = 1e-6
"""Of a receiver without noise, (1 mm)² or (1 mm/s)²: filters take a covariance of zeros as unknown, or divide by it."""
_SEMI_MAJOR_M = 6378137.0
_FLATTENING = 1.0 / 298.257223563
"""Semi-major axis and flattening of the WGS84 ellipsoid."""


@dataclass(frozen=True, slots=True)
class GnssFix:
    """Result of one GNSS measurement, with or without a fix.

    Attributes:
        latitude_deg: WGS84 latitude; NaN without a fix.
        longitude_deg: WGS84 longitude; NaN without a fix.
        altitude_m: Altitude above the ellipsoid; NaN without a fix.
        covariance_m2: (3, 3) covariance of the errors east, north, up; None without a fix.
    """

    latitude_deg: float
    longitude_deg: float
    altitude_m: float
    covariance_m2: Float64Array | None


NO_FIX = GnssFix(math.nan, math.nan, math.nan, None)
"""Result of a measurement during a drop-out, or in a tunnel."""


@dataclass(frozen=True, slots=True)
class GnssVelocitySample:
    """Result of one measurement of the antenna's velocity.

    Attributes:
        velocity_mps: (3,) along the axes of the map frame; NaN without a fix.
        covariance: (3, 3) covariance of its errors, (m/s)²; None without a fix.
    """

    velocity_mps: Float64Array
    covariance: Float64Array | None


class GnssModel:
    """A GNSS receiver that measures throughout one scene."""

    def __init__(
        self,
        gnss: Gnss,
        datum: MapDatum,
        seed: int,
        tick_ns: int,
        period_ticks: int = 1,
        tunnels: Tunnels | None = None,
    ) -> None:
        """Create the receiver at tick 0.

        Args:
            gnss: Configuration of the receiver.
            datum: Position of the map on Earth.
            seed: Seed of the scene.
            tick_ns: Length of a tick.
            period_ticks: Number of ticks between measurements.
            tunnels: Tunnels of the map, in which there is no reception.
        """
        self._tunnels = tunnels or Tunnels.none()
        self._gnss, self._datum, self._seed, self._period_ticks = gnss, datum, seed, period_ticks
        step_s = tick_ns / NS_PER_S * period_ticks
        horizontal_m, vertical_m = gnss.bias_walk_horizontal_sigma_m, gnss.bias_walk_vertical_sigma_m
        self._walk_sigma_m = np.array([horizontal_m, horizontal_m, vertical_m])
        rng = stream(seed, f"gnss.{gnss.name}.bias_walk")
        self._walk_m = Drift.gauss_markov(rng, self._walk_sigma_m, gnss.bias_walk_time_s, step_s)
        rng = stream(seed, f"gnss.{gnss.name}.dropouts")
        self._dropouts = Outages(rng, gnss.dropout_share, gnss.dropout_mean_s, step_s)

    def is_due(self, tick: int) -> bool:
        """Whether the receiver measures at a tick."""
        return tick >= 0 and tick % self._period_ticks == 0

    def measure(self, state: WorldState) -> GnssFix:
        """Measure at a tick that is due; ticks must increase from call to call."""
        index = state.tick // self._period_ticks
        walk_m = self._walk_m.values_until(index)[0]
        if self._dropouts.is_off(index):
            return NO_FIX
        gnss = self._gnss
        antenna_m = map_from_sensor(gnss.pose, state)[:3, 3]
        if self._tunnels.holds(antenna_m[None])[0]:
            return NO_FIX
        latitude_deg, longitude_deg, altitude_m = self._datum.geodetic_from_map(antenna_m)
        east_m, north_m = meters_per_degree(latitude_deg, altitude_m)
        noise = stream(self._seed, f"gnss.{gnss.name}", state.tick).standard_normal(3)  # north, east, up
        sigma_m = [
            gnss.longitude_noise_sigma_deg * east_m,
            gnss.latitude_noise_sigma_deg * north_m,
            gnss.altitude_noise_sigma_m,
        ]
        error_m = np.multiply(sigma_m, noise[[1, 0, 2]]) + walk_m
        return GnssFix(
            latitude_deg + float(error_m[1]) / north_m,
            longitude_deg + float(error_m[0]) / east_m,
            altitude_m + float(error_m[2]),
            np.diag(np.maximum(np.square(sigma_m) + np.square(self._walk_sigma_m), _MIN_VARIANCE)),
        )

    def measure_velocity(self, state: WorldState, fix: GnssFix) -> GnssVelocitySample:
        """Measure the velocity together with a fix of the same tick.

        Raises:
            ValueError: The receiver is configured without velocity.
        """
        gnss, velocity = self._gnss, self._gnss.velocity
        if velocity is None:
            raise ValueError(f"{gnss.name} measures no velocity")
        if fix.covariance_m2 is None:
            return GnssVelocitySample(np.full(3, np.nan), None)
        horizontal_mps, vertical_mps = velocity.horizontal_noise_sigma_mps, velocity.vertical_noise_sigma_mps
        sigma_mps = np.array([horizontal_mps, horizontal_mps, vertical_mps])
        noise = stream(self._seed, f"gnss.{gnss.name}.velocity", state.tick).standard_normal(3)
        arm_m = map_from_sensor(gnss.pose, state)[:3, 3] - vector(state.ego, "x y z")
        antenna_mps = vector(state.ego, "vx vy vz") + np.cross(vector(state.ego, "wx wy wz"), arm_m)
        return GnssVelocitySample(
            antenna_mps + sigma_mps * noise, np.diag(np.maximum(np.square(sigma_mps), _MIN_VARIANCE))
        )


def meters_per_degree(latitude_deg: float, altitude_m: float) -> tuple[float, float]:
    """Length in meters of one degree of longitude (east) and of latitude (north), by WGS84's radii of curvature."""
    eccentricity2 = _FLATTENING * (2.0 - _FLATTENING)
    sine, cosine = np.sin(np.radians(latitude_deg)), np.cos(np.radians(latitude_deg))
    root = np.sqrt(1.0 - eccentricity2 * sine**2)
    east_radius_m = _SEMI_MAJOR_M / root + altitude_m
    north_radius_m = _SEMI_MAJOR_M * (1.0 - eccentricity2) / root**3 + altitude_m
    return float(np.radians(1.0) * east_radius_m * cosine), float(np.radians(1.0) * north_radius_m)
