"""Noise texture for all procedural surfaces and the clouds: periodic and mipmapped."""

from functools import lru_cache

import moderngl
import numpy as np
from scipy.spatial import cKDTree

from simbev_ros.foundation.random import stream
from simbev_ros.foundation.types import Float64Array, UInt8Array
from simbev_ros.simulation.render.gl.programs import TEXTURE_UNITS

SIZE_PX = 256
_SPECTRAL_SLOPES = (1.9, None, 1.5, 1.5)
"""Channels: clouds and stains, pebbles, and two independent ones of medium coarseness."""
_PEBBLES = 6000
_PEBBLE_ROUNDNESS = 0.12


def noise_texture(context: moderngl.Context) -> moderngl.Texture:
    """Create the texture, mipmapped and bound to its unit."""
    texture = context.texture((SIZE_PX, SIZE_PX), 4, noise_image().tobytes())
    texture.build_mipmaps()  # allocates the levels; some drivers would always round up
    for level, image in enumerate(noise_levels()):
        texture.write(image.tobytes(), level=level)
    texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
    texture.use(TEXTURE_UNITS["noise"])
    return texture


def noise_levels() -> list[UInt8Array]:
    """The image and its means over squares of 2, 4, … pixels, down to a single one."""
    image = noise_image()
    sizes_px = (1 << level for level in range(SIZE_PX.bit_length()))
    squares = (image.reshape(SIZE_PX // size_px, size_px, SIZE_PX // size_px, size_px, -1) for size_px in sizes_px)
    return [np.rint(each.mean(axis=(1, 3))).astype(np.uint8) for each in squares]


@lru_cache(maxsize=1)
def noise_image() -> UInt8Array:
    """(256, 256, 4) uint8 noise of spectral amplitude 1/f^slope, or pebbles; values are uniform over 0..255."""
    channels = [
        _equalize(_pebbles(index) if slope is None else _fractal(slope, index))
        for index, slope in enumerate(_SPECTRAL_SLOPES)
    ]
    return (np.stack(channels, axis=-1) * 255.999).astype(np.uint8)


def _fractal(slope: float, index: int) -> Float64Array:
    """(256, 256) periodic noise."""
    white = stream(index, "render.noise").standard_normal((SIZE_PX, SIZE_PX))
    frequency = np.hypot(*np.meshgrid(np.fft.fftfreq(SIZE_PX), np.fft.fftfreq(SIZE_PX)))
    frequency[0, 0] = np.inf
    return np.fft.ifft2(np.fft.fft2(white) * frequency**-slope).real


def _pebbles(index: int) -> Float64Array:
    """(256, 256) periodic pattern of stones, each with its own tone and darker toward its edge."""
    rng = stream(index, "render.noise")
    centers_px, tone = rng.uniform(0.0, SIZE_PX, (_PEBBLES, 2)), rng.random(_PEBBLES)
    pixels_px = np.indices((SIZE_PX, SIZE_PX)).reshape(2, -1).T + 0.5
    distance_px, nearest = cKDTree(centers_px, boxsize=SIZE_PX).query(pixels_px, k=2)
    inside = np.minimum(distance_px[:, 1] - distance_px[:, 0], 1.5)
    return (tone[nearest[:, 0]] + _PEBBLE_ROUNDNESS * inside).reshape(SIZE_PX, SIZE_PX)


def _equalize(values: Float64Array) -> Float64Array:
    """Ranks of the values, scaled to 0..1."""
    ranks = np.empty(values.size)
    ranks[np.argsort(values.ravel(), kind="stable")] = np.linspace(0.0, 1.0, values.size)
    return ranks.reshape(values.shape)
