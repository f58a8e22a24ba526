"""Relief far from roads: smooth random hills that depend only on the map and its seed."""

from dataclasses import dataclass

import numpy as np

from simbev_ros.foundation.random import stream
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.surroundings import ReliefRecipe

_NUM_WAVES = 24


@dataclass(frozen=True, slots=True)
class Relief:
    """Heights of the land without roads; zero mean, twice differentiable.

    A sum of plane waves in random directions, with wavelengths around the recipe's and amplitudes proportional to them;
    three standard deviations of the sum are the recipe's amplitude.

    Attributes:
        wave_number: (2, W) radians per meter along x and y.
        phase_rad: (W,).
        amplitude_m: (W,).
    """

    wave_number: Float64Array
    phase_rad: Float64Array
    amplitude_m: Float64Array

    @classmethod
    def of(cls, recipe: ReliefRecipe, seed: int) -> "Relief":
        """Draw the hills of a recipe from a map's seed."""
        if recipe.amplitude_m == 0.0:
            return cls(np.zeros((2, 0)), np.zeros(0), np.zeros(0))
        rng = stream(seed, "map.relief")
        wavelength_m = recipe.wavelength_m * 2.0 ** rng.uniform(-1.0, 1.0, _NUM_WAVES)
        angle_rad, phase_rad = rng.uniform(0.0, 2.0 * np.pi, (2, _NUM_WAVES))
        wave_number = 2.0 * np.pi / wavelength_m * np.stack([np.cos(angle_rad), np.sin(angle_rad)])
        share = wavelength_m / np.sqrt(np.sum(wavelength_m**2) / 2.0)
        return cls(wave_number, phase_rad, recipe.amplitude_m / 3.0 * share)

    def height_m(self, xy_m: Float64Array) -> Float64Array:
        """(N,) heights at (N, 2) points of the map frame."""
        return np.sin(np.asarray(xy_m) @ self.wave_number + self.phase_rad) @ self.amplitude_m

    def grid_m(self, x_m: Float64Array, y_m: Float64Array) -> Float64Array:
        """(X, Y) heights at all pairs of (X,) and (Y,) coordinates, by sin(a + b) = sin a cos b + cos a sin b."""
        along_x_rad = np.outer(self.wave_number[0], x_m) + self.phase_rad[:, None]
        along_y_rad = np.outer(self.wave_number[1], y_m)
        sin_x, cos_x = self.amplitude_m[:, None] * np.sin(along_x_rad), self.amplitude_m[:, None] * np.cos(along_x_rad)
        sin_y, cos_y = np.sin(along_y_rad), np.cos(along_y_rad)
        height_m = np.zeros((len(x_m), len(y_m)))
        # No matrix product: its rounding may depend on the grid's size, and grids that overlap must agree to the bit.
        for wave in range(len(self.amplitude_m)):
            height_m += np.multiply.outer(sin_x[wave], cos_y[wave])
            height_m += np.multiply.outer(cos_x[wave], sin_y[wave])
        return height_m
