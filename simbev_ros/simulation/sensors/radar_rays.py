"""Random ray directions within a radar's field of view."""

from collections.abc import Callable, Mapping

import numpy as np

from simbev_ros.config.radar import Radar, RayPattern
from simbev_ros.foundation.types import Float64Array


def random_rays(radar: Radar, count: int, rng: np.random.Generator) -> Float64Array:
    """Draw (count, 3) unit vectors, sensor frame: x ahead, y left, z up."""
    half_rad = np.radians([radar.horizontal_fov_deg, radar.vertical_fov_deg]) / 2.0
    return _PATTERNS[radar.ray_pattern](half_rad, rng.random((2, count)))


def _cone(half_rad: Float64Array, draws: Float64Array) -> Float64Array:
    """Uniform over radius and angle of an ellipse, as in CARLA: the inner quarter of its area gets half of the rays."""
    radius, angle_rad = draws[0], 2.0 * np.pi * draws[1]
    left, up = np.tan(half_rad)[:, None] * radius * [np.cos(angle_rad), np.sin(angle_rad)]
    vectors: Float64Array = np.stack([np.ones_like(left), left, up], axis=1)
    vectors /= np.linalg.norm(vectors, axis=1, keepdims=True)
    return vectors


def _even(half_rad: Float64Array, draws: Float64Array) -> Float64Array:
    """Uniform over solid angle: uniform over azimuth and over the sine of elevation."""
    azimuth_rad = half_rad[0] * (2.0 * draws[0] - 1.0)
    sine = np.sin(half_rad[1]) * (2.0 * draws[1] - 1.0)
    level = np.sqrt(1.0 - sine**2)
    return np.stack([level * np.cos(azimuth_rad), level * np.sin(azimuth_rad), sine], axis=1)


_PATTERNS: Mapping[RayPattern, Callable[[Float64Array, Float64Array], Float64Array]] = {"cone": _cone, "even": _even}
