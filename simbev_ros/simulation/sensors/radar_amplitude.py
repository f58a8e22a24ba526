"""Amplitude of radar detections: radar cross-sections of the surfaces that were hit, the radar equation, loss in rain.

Not modeled: the antenna pattern (the field of view ends sharply), and what facets do in phase. So a flat plate has the
lobe of its material's roughness and not 4 π A² / λ²; a trihedral corner has three plates and not 4 π a⁴ / 3 λ².
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from simbev_ros.assets.materials import Material
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.tables import load_table
from simbev_ros.foundation.types import BoolArray, Float64Array, UInt8Array
from simbev_ros.scene.air import rain_halvings_per_m
from simbev_ros.schema.scene.weather import Weather
from simbev_ros.simulation.sensors.lidar_weather import drop_slope_per_m

_RAIN_K, _RAIN_ALPHA = 1.13, 0.712
"""Attenuation k · rate^alpha in dB/km for rain in mm/h: ITU-R P.838-3 at 77 GHz, mean of both polarizations."""
_DROP_SLOPE_PER_M, _DROP_SLOPE_POWER = 4100.0, -0.21
"""Slope of drop sizes in rain of 1 mm/h, and its exponent of the rain rate: Marshall and Palmer, 1948."""
_KM_PER_M = 1e-3
_STEPS = 10_000
_MIN_COS = 0.05


@dataclass(frozen=True)
class CrossSections:
    """Radar cross-sections in m² by material and tag; radar_surfaces.yaml explains the model.

    Attributes:
        diffuse_m2, exponent, specular_m2, spread: (len(Material),) parameters by material.
        reflectance: (len(Material),) share of the power that a material reflects; NaN: it is in the parameters.
        mirror: (len(Material),) share of the power that a flat wall mirrors.
        kind: (256,) factor by semantic tag.
        is_flat: (256,) whether surfaces of a semantic tag are flat enough to be mirrors.
    """

    diffuse_m2: Float64Array
    exponent: Float64Array
    specular_m2: Float64Array
    spread: Float64Array
    reflectance: Float64Array
    mirror: Float64Array
    kind: Float64Array
    is_flat: BoolArray

    def at_incidence(self, material: UInt8Array, tag: UInt8Array, cos_angle: Float64Array) -> Float64Array:
        """(N,) cross-sections in m² of (N,) surfaces at (N,) cosines of the angle of incidence."""
        return self._lobes(material, cos_angle) * self.kind[tag]

    def per_m2(self, material: UInt8Array, cos_angle: Float64Array) -> Float64Array:
        """(N,) cross-sections of a square meter of (N,) surfaces at (N,) cosines of the angle of incidence.

        A sphere, which shows all angles, has its reflectance times π r², the cross-section of geometrical optics.
        """
        return self._lobes(material, cos_angle) * self._sphere_factor[material]

    @cached_property
    def _sphere_factor(self) -> Float64Array:
        """(len(Material),) factor that gives spheres their reflectance: it divides by the mean over their disk."""
        cosine = (np.arange(_STEPS) + 0.5) / _STEPS
        materials = np.arange(len(self.reflectance), dtype=np.uint8)
        in_disks = 2.0 * self._lobes(materials[:, None], cosine[None]).mean(axis=1)
        return np.where(np.isnan(self.reflectance), 1.0, self.reflectance / in_disks)

    def _lobes(self, material: UInt8Array, cos_angle: Float64Array) -> Float64Array:
        cosine = np.clip(cos_angle, 1e-6, 1.0)
        slope = np.sqrt(1.0 - cosine**2) / cosine / self.spread[material]
        diffuse_m2 = self.diffuse_m2[material] * cosine ** self.exponent[material]
        total_m2: Float64Array = diffuse_m2 + self.specular_m2[material] * np.exp(-(np.minimum(slope, 26.0) ** 2))
        return total_m2


@lru_cache(maxsize=1)
def load_cross_sections() -> CrossSections:
    """Load the tables of radar_surfaces.yaml, in which each material is named once."""
    data = load_table("simbev_ros.simulation.sensors", "radar_surfaces.yaml")
    surface_of = {material: surface for surface in data["surfaces"].values() for material in surface["materials"]}

    def column(name: str) -> Float64Array:
        return np.array([surface_of[material.name].get(name, np.nan) for material in Material], np.float64)

    kind_db = np.zeros(256)
    for name, gain_db in data["kinds"].items():
        kind_db[Tag[name]] = gain_db
    return CrossSections(
        diffuse_m2=from_db(column("diffuse")),
        exponent=column("exponent"),
        specular_m2=from_db(column("specular")),
        spread=column("spread"),
        reflectance=from_db(column("reflectance")),
        mirror=np.nan_to_num(from_db(column("mirror"))),
        kind=from_db(kind_db),
        is_flat=np.isin(np.arange(256), [Tag[name] for name in data["mirrors"]]),
    )


def areas_m2(ray_sr: float, path_m: Float64Array, cos_angle: Float64Array) -> Float64Array:
    """(N,) areas of surfaces that rays of a solid angle cover after (N,) paths, at (N,) cosines of incidence."""
    covered_m2: Float64Array = ray_sr * np.square(path_m) / np.maximum(cos_angle, _MIN_COS)
    return covered_m2


def amplitude_db(cross_section_m2: Float64Array, range_m: Float64Array, reference_range_m: float) -> Float64Array:
    """Received power by the radar equation: it decreases with the fourth power of the range.

    Returns:
        (N,) dB relative to the return of 1 m² at the reference range.
    """
    ratio: Float64Array = reference_range_m / np.maximum(range_m, 1e-3)
    return 10.0 * np.log10(cross_section_m2) + 40.0 * np.log10(ratio)


def rain_loss_db_per_m(weather: Weather) -> float:
    """Two-way loss per meter of range at 77 GHz, in the same rain that cameras and lidars see; fog causes none."""
    return float(2.0 * _RAIN_K * rain_rate_mmph(weather) ** _RAIN_ALPHA * _KM_PER_M)


def rain_rate_mmph(weather: Weather) -> float:
    """Rain rate in mm/h that causes the weather's extinction of light; 15 mm/h at precipitation 100."""
    extinction_per_m = rain_halvings_per_m(weather) * np.log(2.0)
    if extinction_per_m == 0.0:
        return 0.0
    return float((drop_slope_per_m(extinction_per_m) / _DROP_SLOPE_PER_M) ** (1.0 / _DROP_SLOPE_POWER))


def from_db(value_db: Float64Array) -> Float64Array:
    """Power ratio of a value in dB."""
    return 10.0 ** (value_db / 10.0)
