"""Strength of lidar echoes by material and angle of incidence, and the random loss of weak ones.

Strength is relative to white paper hit perpendicularly at the same range in clear air. A matte surface has its
reflectance times the cosine of incidence (Lambert). A retroreflective surface sends light back to its source: sheeting
(plates, traffic signs) hundreds of times as strongly as paper, over a wide range of angles; the glass beads in road
markings about as strongly as paper, however grazing the ray. The receiver saturates at 1.
"""

import numpy as np

from simbev_ros.assets.materials import load_materials
from simbev_ros.config.lidar import Lidar
from simbev_ros.foundation.types import BoolArray, Float32Array, UInt8Array


def echo_strength(material: UInt8Array, cos_angle: Float32Array) -> Float32Array:
    """(N,) echo strengths of (N,) materials at (N,) cosines of incidence, not limited by the receiver's saturation."""
    table = load_materials()
    strength: Float32Array = table.lidar_reflectance[material] * cos_angle
    retroreflectors = np.flatnonzero(table.lidar_retroreflection[material] > 0)
    surface = material[retroreflectors]
    strength[retroreflectors] += (
        table.lidar_retroreflection[surface] * cos_angle[retroreflectors] ** table.lidar_retroreflection_fall[surface]
    )
    return strength


def intensity(lidar: Lidar, strength: Float32Array, range_m: Float32Array) -> Float32Array:
    """(N,) intensities 0..1 of echoes; they decrease with the range in clear air as CARLA's do."""
    air = np.exp(np.float32(-lidar.attenuation_per_m) * range_m)
    return np.minimum(strength, np.float32(1.0)) * air


def is_lost_at_low_intensity(lidar: Lidar, intensity: Float32Array, uniform: Float32Array) -> BoolArray:
    """(N,) whether a return is lost because of its low intensity, given (N,) uniform random numbers.

    As CARLA's ``dropoff_zero_intensity`` and ``dropoff_intensity_limit``: the probability of loss decreases linearly
    from its value at intensity 0 to zero at the limit.
    """
    probability = lidar.drop_off_at_zero_intensity * (1.0 - intensity / lidar.drop_off_intensity_limit)
    return uniform < probability
