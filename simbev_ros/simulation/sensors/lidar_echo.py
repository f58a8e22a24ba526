"""Strength of lidar echoes by material and angle of incidence, and the random loss of weak ones in the paper's model.

Strength is relative to white paper hit perpendicularly at the same range in clear air. A matte surface has its
reflectance times the cosine of incidence (Lambert). A retroreflective surface sends light back to its source: sheeting
(plates, traffic signs) hundreds of times as strongly as paper, over a wide range of angles; the glass beads in road
markings about as strongly as paper, however grazing the ray. The receiver saturates at 1.
"""

import numpy as np

from simbev_ros.assets.materials import Material, load_materials
from simbev_ros.config.lidar import Lidar
from simbev_ros.foundation.types import BoolArray, Float32Array, UInt8Array, UInt32Array

_MAX_SLOPE_RAD = 0.6  # standard deviation of the slopes of a surface of roughness 1
_LEAF_COS = 2.0 / 3.0  # mean cosine of incidence of leaves in all directions, by the area that a ray sees of each
_DARK_PAINT = 0.2  # reflectance of black paint divided by that of the table, the mean of black and white


def echo_strength(material: UInt8Array, cos_angle: Float32Array) -> Float32Array:
    """(N,) echo strengths of (N,) materials at (N,) cosines of incidence, not limited by the receiver's saturation."""
    table = load_materials()
    return table.lidar_reflectance[material] * cos_angle + _retroreflection(material, cos_angle)


def surface_strength(material: UInt8Array, cos_angle: Float32Array, color: UInt32Array, wetness: float) -> Float32Array:
    """(N,) strengths of surfaces as they are, for receivers that decide by power.

    Matte surfaces are rough: at grazing incidence they send more light back to its source than Lambert's law says
    (Oren and Nayar, "Generalization of Lambert's reflectance model", 1994, seen from the source; the slopes' standard
    deviation follows from the material's roughness; at normal incidence the strength is the reflectance). Leaves face
    all directions, whatever the surface of their crown. Smooth surfaces add a lobe around the normal (Cook and Torrance
    with the distribution of Trowbridge and Reitz).

    Args:
        material: (N,) materials.
        cos_angle: (N,) cosines of the angle of incidence.
        color: (N,) 0xRRGGBB of the actors, which car paint has; dark paint is dark to lidars too.
        wetness: 0 dry to 1 wet.
    """
    table = load_materials()
    cos2 = np.square(cos_angle)
    variance = np.square(_MAX_SLOPE_RAD * table.roughness)
    rough = 0.45 * variance / (variance + 0.09) / (1.0 - 0.5 * variance / (variance + 0.33))
    diffuse = table.lidar_reflectance * (1.0 - wetness * (1.0 - table.lidar_wet))
    strength = diffuse.take(material) * (cos_angle + rough.take(material) * (1.0 - cos2))
    leaves = np.flatnonzero(material == Material.FOLIAGE)
    strength[leaves] = diffuse[Material.FOLIAGE] * _LEAF_COS
    painted = np.flatnonzero(material == Material.CAR_PAINT)
    strength[painted] *= _paint_factor(color[painted])
    alpha2 = np.square(np.square(table.roughness))
    mirrored = table.specular * (1.0 - table.metallic) + table.lidar_reflectance * table.metallic
    alpha2_here = alpha2.take(material)
    spread = cos2 * (alpha2_here - 1.0) + 1.0
    seen = 2.0 / (cos_angle + np.sqrt(alpha2_here + (1.0 - alpha2_here) * cos2))  # Smith's masking over the cosine
    lobe = (mirrored * alpha2 / 4.0).take(material) * cos_angle * np.square(seen / spread)
    return (strength + lobe + _retroreflection(material, cos_angle)).astype(np.float32)


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


def _retroreflection(material: UInt8Array, cos_angle: Float32Array) -> Float32Array:
    """(N,) strengths of what retroreflectors send back."""
    table = load_materials()
    strength = np.zeros(len(material), np.float32)
    retroreflectors = np.flatnonzero((table.lidar_retroreflection > 0).take(material))
    surface = material[retroreflectors]
    strength[retroreflectors] = (
        table.lidar_retroreflection[surface] * cos_angle[retroreflectors] ** table.lidar_retroreflection_fall[surface]
    )
    return strength


def _paint_factor(color: UInt32Array) -> Float32Array:
    """(N,) reflectances of paint relative to the table's, by (N,) colors: the table has the mean of black and white."""
    srgb = (color[:, None] >> np.array([16, 8, 0], np.uint32) & 0xFF) / 255.0
    luminance = np.power(srgb, 2.2) @ [0.2126, 0.7152, 0.0722]
    return (_DARK_PAINT + (2.0 - 2.0 * _DARK_PAINT) * luminance).astype(np.float32)
