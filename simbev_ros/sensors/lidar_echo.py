"""How strong a lidar's echoes are, and which of them are lost at random.

Strength is relative to that of white paper, seen straight on, at the same range in clear air. A matt surface gives its
reflectance times the cosine of incidence (Lambert). A retroreflective one sends light back where it came from: sheeting
(plates, traffic signs) hundreds of times as strongly as paper, from a wide range of angles; the glass beads in road
markings about as strongly as paper however flat the ray comes in. The receiver saturates at 1.
"""

import numpy as np

from simbev_ros.assets.materials import load_materials
from simbev_ros.config.lidar import Lidar
from simbev_ros.types import BoolArray, Float32Array, UInt8Array


def echo_strength(material: UInt8Array, cos_angle: Float32Array) -> Float32Array:
    """(N,) strengths of (N,) surfaces, not limited to what a receiver can tell apart."""
    table = load_materials()
    strength: Float32Array = table.lidar_reflectance[material] * cos_angle
    mirrors = np.flatnonzero(table.lidar_retroreflection[material] > 0)
    surface = material[mirrors]
    strength[mirrors] += (
        table.lidar_retroreflection[surface] * cos_angle[mirrors] ** table.lidar_retroreflection_fall[surface]
    )
    return strength


def intensity(lidar: Lidar, strength: Float32Array, range_m: Float32Array) -> Float32Array:
    """(N,) intensities 0..1 of echoes; in clear air they fall with the range as CARLA's do."""
    air = np.exp(np.float32(-lidar.attenuation_per_m) * range_m)
    result: Float32Array = np.minimum(strength, np.float32(1.0)) * air
    return result


def lost_for_weakness(lidar: Lidar, intensity: Float32Array, lottery: Float32Array) -> BoolArray:
    """(N,) whether a return is lost because of its intensity, given (N,) uniform random numbers.

    As CARLA's ``dropoff_zero_intensity`` and ``dropoff_intensity_limit``: the share that is lost falls evenly from
    that at intensity 0 to none at the limit.
    """
    share = lidar.drop_off_at_zero_intensity * (1.0 - intensity / lidar.drop_off_intensity_limit)
    lost: BoolArray = lottery < share
    return lost
