"""GNSS receiver: world state in, position on Earth out. No ROS."""

from dataclasses import dataclass

import numpy as np

from simbev_ros.config.positioning import Gnss
from simbev_ros.geometry.geodesy import MapDatum
from simbev_ros.random import stream
from simbev_ros.scene.state import WorldState
from simbev_ros.sensors.mount import map_from_sensor
from simbev_ros.types import Float64Array

_SEMI_MAJOR_M = 6378137.0
_FLATTENING = 1.0 / 298.257223563
"""WGS84."""


@dataclass(frozen=True, slots=True)
class GnssFix:
    """One fix.

    Attributes:
        latitude_deg: WGS84.
        longitude_deg: WGS84.
        altitude_m: Above the ellipsoid.
        covariance_m2: (3, 3) of the noise: east, north, up.
    """

    latitude_deg: float
    longitude_deg: float
    altitude_m: float
    covariance_m2: Float64Array


def measure_gnss(gnss: Gnss, state: WorldState, datum: MapDatum, seed: int) -> GnssFix:
    """Position of the antenna with normally distributed errors; ``seed`` is the scene's."""
    antenna_m = map_from_sensor(gnss.pose, state)[:3, 3]
    latitude_deg, longitude_deg, altitude_m = datum.geodetic_from_map(antenna_m)
    errors = stream(seed, f"gnss.{gnss.name}", state.tick).standard_normal(3)
    east_m, north_m = metres_per_degree(latitude_deg, altitude_m)
    sigmas_m = [
        gnss.longitude_noise_sigma_deg * east_m,
        gnss.latitude_noise_sigma_deg * north_m,
        gnss.altitude_noise_sigma_m,
    ]
    return GnssFix(
        latitude_deg + gnss.latitude_noise_sigma_deg * float(errors[0]),
        longitude_deg + gnss.longitude_noise_sigma_deg * float(errors[1]),
        altitude_m + gnss.altitude_noise_sigma_m * float(errors[2]),
        np.diag(np.square(sigmas_m)),
    )


def metres_per_degree(latitude_deg: float, altitude_m: float) -> tuple[float, float]:
    """Length of one degree of longitude (eastward) and of latitude (northward), by WGS84's radii of curvature."""
    eccentricity2 = _FLATTENING * (2.0 - _FLATTENING)
    sine, cosine = np.sin(np.radians(latitude_deg)), np.cos(np.radians(latitude_deg))
    root = np.sqrt(1.0 - eccentricity2 * sine**2)
    east_radius_m = _SEMI_MAJOR_M / root + altitude_m
    north_radius_m = _SEMI_MAJOR_M * (1.0 - eccentricity2) / root**3 + altitude_m
    return float(np.radians(1.0) * east_radius_m * cosine), float(np.radians(1.0) * north_radius_m)
