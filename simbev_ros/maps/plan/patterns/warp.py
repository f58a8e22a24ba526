"""A smooth warp of the plane that makes roads planned on straight lines look naturally grown."""

from dataclasses import dataclass

import numpy as np

from simbev_ros.foundation.types import Float64Array

_NUM_WAVES = 6
_MAX_GRADIENT = 0.45  # displacement per meter; below 1 the warp does not fold over


@dataclass(frozen=True, slots=True)
class Warp:
    """A displacement field made of plane waves; it preserves the topology of the plan.

    Attributes:
        wave_number: (2, K) radians per meter.
        phase_rad: (K,) phases.
        amplitude_m: (2, K) amplitudes of the displacement in x and y.
    """

    wave_number: Float64Array
    phase_rad: Float64Array
    amplitude_m: Float64Array

    def __call__(self, points_m: Float64Array) -> Float64Array:
        """(N, 2) warped positions of (N, 2) points."""
        return np.asarray(points_m + np.sin(points_m @ self.wave_number + self.phase_rad) @ self.amplitude_m.T)


def draw_warp(rng: np.random.Generator, amplitude_m: float, wavelength_m: float) -> Warp:
    """Draw a warp of about the given amplitude and wavelength, with less amplitude where it would fold over."""
    length_m = wavelength_m * 2.0 ** rng.uniform(-0.5, 0.5, _NUM_WAVES)
    angle_rad, phase_rad, direction_rad = rng.uniform(0.0, 2.0 * np.pi, (3, _NUM_WAVES))
    wave_number = 2.0 * np.pi / length_m * np.stack([np.cos(angle_rad), np.sin(angle_rad)])
    amplitude = amplitude_m / np.sqrt(_NUM_WAVES) * np.stack([np.cos(direction_rad), np.sin(direction_rad)])
    steepness = float(np.sum(np.linalg.norm(amplitude, axis=0) * np.linalg.norm(wave_number, axis=0)))
    return Warp(wave_number, phase_rad, amplitude * min(1.0, _MAX_GRADIENT / steepness))
