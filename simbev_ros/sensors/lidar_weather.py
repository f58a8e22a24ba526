"""What rain and fog do to a lidar: echoes get weaker, some are lost, and drops give echoes of their own.

All follows from the extinction that cameras see too (``scene/air``). An echo that comes back through it is weaker by
its square. A lidar is taken to be able to detect a target of 10 % at its range in clear air, and at no range one below
0.1 %; what it detects in clear air all the same it loses with the share by which its echo falls below that. Of several
echoes of a ray the strongest counts. Air gives echoes in two ways:

* Fog scatters back from everywhere (Rasshofer, Spies and Spies, "Influences of weather phenomena on automotive laser
  radar systems", 2011; Hahner et al., "Fog simulation on real lidar point clouds for 3D object detection in adverse
  weather", ICCV 2021): the backscatter coefficient is 0.046 over the meteorological optical range, ln 20 over the
  extinction. Of a volume with very many droplets the echo is speckle, its strength exponentially distributed.
* Rain has single drops in the narrow beam near the sensor (Kilic et al., "Lidar light scattering augmentation (LISA)",
  2021), whose sizes follow Marshall and Palmer (1948). A drop echoes by its share of the beam's area and by Fresnel's
  reflectance of water.
"""

from dataclasses import dataclass

import numpy as np

from simbev_ros.config.lidar import Lidar
from simbev_ros.scene.air import extinction_per_m, optical_depth
from simbev_ros.scene.weather import Weather
from simbev_ros.types import BoolArray, Float32Array, Float64Array

_REFERENCE = 0.1
_LEAST = 1e-3
_NEAREST_M = 1.0
"""From here on the receiver sees all of the beam; nearer echoes are not detected (Hahner et al. 2021)."""

_PULSE_M = 0.75
"""Half the way of light in a pulse of 5 ns: from so deep echoes come at the same time."""

_FOG_BACKSCATTER = 0.046 / np.log(20.0)
_DROP_REFLECTANCE = ((1.33 - 1.0) / (1.33 + 1.0)) ** 2
_DROPS_PER_M4 = 8e6
_STEPS = 400
_DARK = 500.0
"""Optical depths from which on nothing is left, and which still leave numbers that can be divided by."""


@dataclass(frozen=True, slots=True)
class Echoes:
    """What air sends back of (N,) rays.

    Attributes:
        range_m: (N,) inf where nothing is detected.
        strength: (N,) as in ``lidar_echo``, extinction included; 0 there.
    """

    range_m: Float32Array
    strength: Float32Array


class LidarWeather:
    """The air of one scan."""

    def __init__(self, lidar: Lidar, weather: Weather, height_m: float) -> None:
        """Takes the lidar's height in the map; fog near it is as thick as there."""
        self._lidar, self._weather, self._height_m = lidar, weather, height_m
        self._fog_per_m, self._rain_per_m = extinction_per_m(weather, height_m)
        step_m = np.geomspace(_NEAREST_M, max(lidar.range_m, 2.0 * _NEAREST_M), _STEPS)
        in_fog_m = np.maximum(step_m - weather.fog_distance_m, 0.0)
        self._step_m = step_m
        self._clear = np.exp(-np.minimum(2.0 * (self._fog_per_m * in_fog_m + self._rain_per_m * step_m), _DARK))
        self._in_fog = in_fog_m > 0.0

    @property
    def is_clear(self) -> bool:
        """Whether there is neither rain nor fog, and nothing changes."""
        weather = self._weather
        return not self._lidar.weather_effects or weather.fog_density + weather.precipitation == 0.0

    def share_left(self, range_m: Float32Array, upward: Float32Array) -> Float32Array:
        """(N,) share of an echo that is left after (N,) metres there and back; ``upward`` is z of the unit vectors."""
        start_m = np.full(len(range_m), self._height_m)
        depth = optical_depth(self._weather, start_m, start_m + upward * range_m, range_m.astype(np.float64))
        return np.exp(-2.0 * depth).astype(np.float32)

    def detected(
        self, strength: Float32Array, left: Float32Array, range_m: Float32Array, lottery: Float32Array
    ) -> BoolArray:
        """(N,) whether echoes of (N,) strength in clear air are still detected, given (N,) uniform random numbers."""
        least = self._least(range_m)
        detected: BoolArray = lottery * least < np.maximum(strength, least) * left
        return detected

    def from_air(self, count: int, rng: np.random.Generator) -> Echoes:
        """The strongest detected echo of fog and drops along each of ``count`` rays."""
        fog, drops = self._from_fog(count, rng), self._from_drops(count, rng)
        stronger = drops.strength / drops.range_m**2 > fog.strength / fog.range_m**2
        range_m = np.where(stronger, drops.range_m, fog.range_m)
        strength = np.where(stronger, drops.strength, fog.strength)
        seen = strength > self._least(range_m)
        return Echoes(np.where(seen, range_m, np.float32(np.inf)), np.where(seen, strength, np.float32(0.0)))

    def _least(self, range_m: Float32Array) -> Float32Array:
        """(N,) strengths that are just detected."""
        least: Float32Array = np.maximum(_REFERENCE * np.square(range_m / self._lidar.range_m), _LEAST)
        return least.astype(np.float32)

    def _from_fog(self, count: int, rng: np.random.Generator) -> Echoes:
        """One echo of each ray, from where the received power is likely to come, with the strength of speckle."""
        place, speckle = rng.random(count, np.float32), rng.standard_exponential(count, np.float32)
        power = np.where(self._in_fog, self._clear / self._step_m**2, 0.0)
        if self._fog_per_m == 0.0 or not power.any():
            return Echoes(np.full(count, 1.0, np.float32), np.zeros(count, np.float32))
        sums = _integrated(power, self._step_m)
        range_m = np.interp(place, sums / sums[-1], self._step_m)
        mean = np.pi * _FOG_BACKSCATTER * self._fog_per_m * _PULSE_M * np.interp(range_m, self._step_m, self._clear)
        return Echoes(range_m.astype(np.float32), (mean * speckle).astype(np.float32))

    def _from_drops(self, count: int, rng: np.random.Generator) -> Echoes:
        """The first drop of each ray that is large enough to be seen."""
        place, size = rng.standard_exponential(count, np.float32), rng.standard_exponential(count, np.float32)
        range_m, strength = np.ones(count, np.float32), np.zeros(count, np.float32)
        if self._rain_per_m == 0.0:
            return Echoes(range_m, strength)
        slope_per_m = drop_slope_per_m(self._rain_per_m)
        beam_m = self._lidar.beam_divergence_mrad * 1e-3 * self._step_m
        smallest_m = beam_m * np.sqrt(self._least(self._step_m.astype(np.float32)) / _DROP_REFLECTANCE / self._clear)
        per_m3 = _DROPS_PER_M4 / slope_per_m * np.exp(-slope_per_m * smallest_m)
        sums = _integrated(per_m3 * np.pi / 4.0 * beam_m**2, self._step_m)
        met = np.flatnonzero(place < sums[-1])
        range_m[met] = np.interp(place[met], sums, self._step_m)
        at_m, clear = range_m[met], np.interp(range_m[met], self._step_m, self._clear)
        diameter_m = np.interp(at_m, self._step_m, smallest_m) + size[met] / slope_per_m
        share = np.minimum(diameter_m / np.interp(at_m, self._step_m, beam_m), 1.0)
        strength[met] = _DROP_REFLECTANCE * share**2 * clear
        return Echoes(range_m, strength)


def drop_slope_per_m(rain_per_m: float) -> float:
    """Λ of Marshall and Palmer's N0 exp(-Λ D), with N0 = 8000 per m³ and mm, at which rain has an extinction.

    Drops are large against the wavelength and extinguish by twice their cross-section: N0 π / Λ³.
    """
    return float(np.cbrt(_DROPS_PER_M4 * np.pi / rain_per_m))


def _integrated(values: Float64Array, step_m: Float64Array) -> Float64Array:
    """(N,) integrals from the first of (N,) places to each."""
    pieces = (values[1:] + values[:-1]) / 2.0 * np.diff(step_m)
    return np.concatenate([[0.0], np.cumsum(pieces)])
