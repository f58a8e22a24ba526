"""Effects of rain and fog on a lidar: they weaken echoes, lose some of them, and add echoes of drops and droplets.

All effects follow from the extinction that cameras see too (``scene/air``). The echo of a target is weakened by the
square of the one-way transmission. A lidar is assumed to detect a target of 10 % reflectance up to its maximum range in
clear air, and a target below 0.1 % at no range. An echo that is weaker than this limit already in clear air is lost
with a probability that equals its loss of strength. The strongest of several echoes of a ray counts. Air returns echoes
in two ways:

* Fog scatters light back from everywhere (Rasshofer, Spies and Spies, "Influences of weather phenomena on automotive
  laser radar systems", 2011; Hahner et al., "Fog simulation on real lidar point clouds for 3D object detection in
  adverse weather", ICCV 2021): the backscatter coefficient is 0.046 over the meteorological optical range, which is
  ln 20 over the extinction. The echo of a volume with very many droplets is speckle: its strength is exponentially
  distributed.
* Rain has single drops in the narrow beam near the sensor (Kilic et al., "Lidar light scattering augmentation (LISA)",
  2021), in sizes by Marshall and Palmer (1948). The strength of a drop's echo is its share of the beam's area
  times Fresnel's reflectance of water.
"""

from dataclasses import dataclass

import numpy as np

from simbev_ros.config.lidar import Lidar
from simbev_ros.foundation.types import BoolArray, Float32Array, Float64Array
from simbev_ros.scene.air import extinction_per_m, fog_halvings_per_m, optical_depth, rain_halvings_per_m
from simbev_ros.schema.scene.weather import Weather

_REFERENCE_REFLECTANCE = 0.1
_MIN_REFLECTANCE = 1e-3
_MIN_RANGE_M = 1.0
"""Range from which the receiver sees the whole beam; nearer echoes are not detected (Hahner et al. 2021)."""

_PULSE_M = 0.75
"""Half the distance that light travels during a pulse of 5 ns: depth from which echoes arrive at the same time."""

_FOG_BACKSCATTER = 0.046 / np.log(20.0)
_DROP_REFLECTANCE = ((1.33 - 1.0) / (1.33 + 1.0)) ** 2
_DROPS_PER_M4 = 8e6
_STEPS = 400
_MAX_DEPTH = 500.0
"""Upper bound of optical depth: practically no transmission, but still a number that can be divided by."""


@dataclass(frozen=True, slots=True)
class AirEchoes:
    """Echoes of the air along (N,) rays.

    Attributes:
        range_m: (N,) range; inf where nothing is detected.
        strength: (N,) strength as in ``lidar_echo``, including extinction; 0 where nothing is detected.
    """

    range_m: Float32Array
    strength: Float32Array

    def of(self, rays: slice) -> "AirEchoes":
        """The echoes along some of the rays."""
        return AirEchoes(self.range_m[rays], self.strength[rays])


class LidarWeather:
    """Rain and fog during one scan, as seen from one lidar."""

    def __init__(self, lidar: Lidar, weather: Weather, height_m: float) -> None:
        """Precompute the air for a lidar at a height of the map frame; fog near the lidar has the density there."""
        self._lidar, self._weather, self._height_m = lidar, weather, height_m
        self._fog_per_m, self._rain_per_m = extinction_per_m(weather, height_m)
        step_m = np.geomspace(_MIN_RANGE_M, max(lidar.range_m, 2.0 * _MIN_RANGE_M), _STEPS)
        in_fog_m = np.maximum(step_m - weather.fog_distance_m, 0.0)
        self._step_m = step_m
        self._clear = np.exp(-np.minimum(2.0 * (self._fog_per_m * in_fog_m + self._rain_per_m * step_m), _MAX_DEPTH))
        self._in_fog = in_fog_m > 0.0

    @property
    def is_clear(self) -> bool:
        """Whether the weather changes nothing: there is neither rain nor fog, or the lidar ignores weather."""
        halvings_per_m = fog_halvings_per_m(self._weather) + rain_halvings_per_m(self._weather)
        return not self._lidar.weather_effects or halvings_per_m == 0.0

    def two_way_transmission(self, range_m: Float32Array, upward: Float32Array) -> Float32Array:
        """(N,) transmission over (N,) meters there and back; ``upward`` is the z of the rays' unit vectors."""
        start_m = np.full(len(range_m), self._height_m)
        depth = optical_depth(self._weather, start_m, start_m + upward * range_m, range_m.astype(np.float64))
        return np.exp(-2.0 * depth).astype(np.float32)

    def are_detected(
        self, strength: Float32Array, transmission: Float32Array, range_m: Float32Array, uniform: Float32Array
    ) -> BoolArray:
        """(N,) whether targets with (N,) strengths in clear air are still detected.

        Args:
            strength: (N,) strengths in clear air, as in ``lidar_echo``.
            transmission: (N,) two-way transmissions.
            range_m: (N,) ranges.
            uniform: (N,) uniform random numbers.
        """
        threshold = self._detection_threshold(range_m)
        return uniform * threshold < np.maximum(strength, threshold) * transmission

    def air_echoes(self, count: int, rng: np.random.Generator) -> AirEchoes:
        """Draw the strongest detected echo of fog and drops along each of ``count`` rays."""
        fog, drops = self._fog_echoes(count, rng), self._drop_echoes(count, rng)
        stronger = drops.strength / drops.range_m**2 > fog.strength / fog.range_m**2
        range_m = np.where(stronger, drops.range_m, fog.range_m)
        strength = np.where(stronger, drops.strength, fog.strength)
        seen = strength > self._detection_threshold(range_m)
        return AirEchoes(np.where(seen, range_m, np.float32(np.inf)), np.where(seen, strength, np.float32(0.0)))

    def _detection_threshold(self, range_m: Float32Array) -> Float32Array:
        """(N,) strengths that are just detected at (N,) ranges."""
        threshold: Float32Array = np.maximum(
            _REFERENCE_REFLECTANCE * np.square(range_m / self._lidar.range_m), _MIN_REFLECTANCE
        )
        return threshold.astype(np.float32)

    def _fog_echoes(self, count: int, rng: np.random.Generator) -> AirEchoes:
        """Draw an echo for each ray: its range is distributed as the received power, its strength as speckle."""
        depth_draw, speckle = rng.random(count, np.float32), rng.standard_exponential(count, np.float32)
        power = np.where(self._in_fog, self._clear / self._step_m**2, 0.0)
        if self._fog_per_m == 0.0 or not power.any():
            return AirEchoes(np.full(count, 1.0, np.float32), np.zeros(count, np.float32))
        sums = _cumulative_integral(power, self._step_m)
        range_m = np.interp(depth_draw, sums / sums[-1], self._step_m)
        mean = np.pi * _FOG_BACKSCATTER * self._fog_per_m * _PULSE_M * np.interp(range_m, self._step_m, self._clear)
        return AirEchoes(range_m.astype(np.float32), (mean * speckle).astype(np.float32))

    def _drop_echoes(self, count: int, rng: np.random.Generator) -> AirEchoes:
        """The echo of each ray's first drop that is large enough to be detected."""
        depth_draw, size_draw = rng.standard_exponential(count, np.float32), rng.standard_exponential(count, np.float32)
        range_m, strength = np.ones(count, np.float32), np.zeros(count, np.float32)
        if self._rain_per_m == 0.0:
            return AirEchoes(range_m, strength)
        slope_per_m = drop_slope_per_m(self._rain_per_m)
        beam_m = self._lidar.beam_divergence_mrad * 1e-3 * self._step_m
        min_diameter_m = beam_m * np.sqrt(
            self._detection_threshold(self._step_m.astype(np.float32)) / _DROP_REFLECTANCE / self._clear
        )
        per_m3 = _DROPS_PER_M4 / slope_per_m * np.exp(-slope_per_m * min_diameter_m)
        sums = _cumulative_integral(per_m3 * np.pi / 4.0 * beam_m**2, self._step_m)
        hits = np.flatnonzero(depth_draw < sums[-1])
        range_m[hits] = np.interp(depth_draw[hits], sums, self._step_m)
        at_m, clear = range_m[hits], np.interp(range_m[hits], self._step_m, self._clear)
        diameter_m = np.interp(at_m, self._step_m, min_diameter_m) + size_draw[hits] / slope_per_m
        share = np.minimum(diameter_m / np.interp(at_m, self._step_m, beam_m), 1.0)
        strength[hits] = _DROP_REFLECTANCE * share**2 * clear
        return AirEchoes(range_m, strength)


def drop_slope_per_m(rain_per_m: float) -> float:
    """Slope Λ of Marshall and Palmer's drop sizes N0 exp(-Λ D), N0 = 8000 per m³ and mm, for a given extinction.

    Drops are large compared with the wavelength, so a drop's extinction is twice its cross-section; in sum N0 π / Λ³.
    """
    return float(np.cbrt(_DROPS_PER_M4 * np.pi / rain_per_m))


def _cumulative_integral(values: Float64Array, step_m: Float64Array) -> Float64Array:
    """(N,) integrals of (N,) values from the first of (N,) ranges up to each, by the trapezoidal rule."""
    pieces = (values[1:] + values[:-1]) / 2.0 * np.diff(step_m)
    return np.concatenate([[0.0], np.cumsum(pieces)])
