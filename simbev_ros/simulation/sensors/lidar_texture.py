"""Reflectance that differs from spot to spot of one material: patches, tracks and dirt of decimeters to meters.

Static surfaces alone have it, by their position. Asphalt's amplitude and the spectrum were fitted to the differences of
intensity along rings on near roads in a real cloud (HDL-32E): 0.3 dB at 0.3 m, 0.9 dB at 1.2 m.
"""

from functools import lru_cache

import numpy as np

from simbev_ros.assets.materials import load_materials
from simbev_ros.foundation.random import stream
from simbev_ros.foundation.types import Float32Array
from simbev_ros.simulation.raycast.scene import Hits

_CELL_M = 0.1
_CELLS = 512  # a power of 2
_LONGEST_M = 6.0  # wavelength above which power no longer rises
_SLOPE = 1.7  # amplitude falls with this power of the frequency
_STEP = 1 / 32
_AMPLITUDE_PER_DB = np.float32(np.log(10.0) / 10.0)


def texture_factor(hits: Hits, point_m: Float32Array) -> Float32Array:
    """(N,) factors on the reflectances of surfaces that were hit at (N, 3) points, map frame."""
    amplitude = (_AMPLITUDE_PER_DB * load_materials().lidar_texture_db).take(hits.material) * (hits.row < 0)
    x_m, y_m, z_m = point_m.T
    across_x, across_y, across_z = np.abs(hits.normal.T)
    is_wall = across_z < np.maximum(across_x, across_y)
    places_m = np.where(is_wall & (across_x > across_y), y_m, x_m), np.where(is_wall, z_m, y_m)
    per_m = np.float32(1.0 / _CELL_M)
    column, row = (np.floor(place_m * per_m).astype(np.int32) & (_CELLS - 1) for place_m in places_m)
    factor: Float32Array = np.exp(amplitude * _pattern().take(row * _CELLS + column))
    return factor


@lru_cache(maxsize=1)
def _pattern() -> Float32Array:
    """(_CELLS, _CELLS) periodic noise with mean 0 and standard deviation 1, in steps that hide differences of FFTs."""
    white = stream(0, "lidar.texture").standard_normal((_CELLS, _CELLS))
    per_m = np.hypot(*np.meshgrid(np.fft.fftfreq(_CELLS, _CELL_M), np.fft.fftfreq(_CELLS, _CELL_M)))
    noise = np.fft.ifft2(np.fft.fft2(white) * np.hypot(per_m, 1.0 / _LONGEST_M) ** -_SLOPE).real
    noise = (noise - noise.mean()) / noise.std()
    return (np.round(noise / _STEP) * _STEP).astype(np.float32)
