"""The shape of the land far from roads: smooth random hills, the same for the same map and seed."""

import numpy as np

from simbev_ros.maps.surroundings import ReliefRecipe
from simbev_ros.random import stream
from simbev_ros.types import Float64Array

_WAVES = 24


def relief_m(recipe: ReliefRecipe, seed: int, xy_m: Float64Array) -> Float64Array:
    """(N,) heights of the undisturbed land at (N, 2) points of the map frame; 0 on average, twice differentiable.

    A sum of plane waves in random directions, of wavelengths around the recipe's, each as high as it is long; three
    standard deviations of the sum are the recipe's amplitude.
    """
    if recipe.amplitude_m == 0.0:
        return np.zeros(len(xy_m))
    rng = stream(seed, "map.relief")
    wavelength_m = recipe.wavelength_m * 2.0 ** rng.uniform(-1.0, 1.0, _WAVES)
    angle_rad, phase_rad = rng.uniform(0.0, 2.0 * np.pi, (2, _WAVES))
    wave_number = 2.0 * np.pi / wavelength_m * np.stack([np.cos(angle_rad), np.sin(angle_rad)])
    weight = wavelength_m / np.sqrt(np.sum(wavelength_m**2) / 2.0)
    height: Float64Array = np.sin(np.asarray(xy_m) @ wave_number + phase_rad) @ weight
    return np.asarray(recipe.amplitude_m / 3.0 * height)
