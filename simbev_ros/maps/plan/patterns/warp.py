"""A smooth warp of the plane, so that what was planned on straight lines lies on the land as if it had grown there."""

from dataclasses import dataclass

import numpy as np

from simbev_ros.types import Float64Array

_WAVES = 6
_STEEPEST = 0.45  # of a displacement per metre: below 1 nothing folds over


@dataclass(frozen=True, slots=True)
class Warp:
    """Displacements that are sums of plane waves: nothing that was apart meets, nothing that met comes apart.

    Attributes:
        wave_number: (2, K) radians per metre.
        phase_rad: (K,)
        amplitude_m: (2, K) of the displacement in x and y.
    """

    wave_number: Float64Array
    phase_rad: Float64Array
    amplitude_m: Float64Array

    def __call__(self, points_m: Float64Array) -> Float64Array:
        """(N, 2) places to which (N, 2) places move."""
        return np.asarray(points_m + np.sin(points_m @ self.wave_number + self.phase_rad) @ self.amplitude_m.T)


def draw_warp(rng: np.random.Generator, amplitude_m: float, wavelength_m: float) -> Warp:
    """A warp whose displacements reach about an amplitude, with waves around a length, weaker where it would fold."""
    length_m = wavelength_m * 2.0 ** rng.uniform(-0.5, 0.5, _WAVES)
    angle_rad, phase_rad, direction_rad = rng.uniform(0.0, 2.0 * np.pi, (3, _WAVES))
    wave_number = 2.0 * np.pi / length_m * np.stack([np.cos(angle_rad), np.sin(angle_rad)])
    amplitude = amplitude_m / np.sqrt(_WAVES) * np.stack([np.cos(direction_rad), np.sin(direction_rad)])
    steepness = float(np.sum(np.linalg.norm(amplitude, axis=0) * np.linalg.norm(wave_number, axis=0)))
    return Warp(wave_number, phase_rad, amplitude * min(1.0, _STEEPEST / steepness))
