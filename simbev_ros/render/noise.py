"""The noise that all procedural surfaces and the clouds are made from: a repeating texture, filtered by mipmaps."""

import moderngl
import numpy as np

from simbev_ros.random import stream
from simbev_ros.render.programs import TEXTURE_UNITS
from simbev_ros.types import Float64Array, UInt8Array

SIZE_PX = 256
_SPECTRAL_SLOPES = (1.9, 0.6, 1.5, 1.5)
"""Channels: clouds and stains, fine grain, and two of middling coarseness that are independent of each other."""


def noise_texture(context: moderngl.Context) -> moderngl.Texture:
    """The texture, mipmapped and bound to its unit."""
    texture = context.texture((SIZE_PX, SIZE_PX), 4, noise_image().tobytes())
    texture.build_mipmaps()
    texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
    texture.use(TEXTURE_UNITS["noise"])
    return texture


def noise_image() -> UInt8Array:
    """(256, 256, 4) uint8 noise of spectral amplitude 1/f^slope; values are spread evenly over 0..255."""
    channels = [_fractal(slope, index) for index, slope in enumerate(_SPECTRAL_SLOPES)]
    return (np.stack(channels, axis=-1) * 255.999).astype(np.uint8)


def _fractal(slope: float, index: int) -> Float64Array:
    """(256, 256) periodic noise; values are ranks, 0..1."""
    white = stream(index, "render.noise").standard_normal((SIZE_PX, SIZE_PX))
    frequency = np.hypot(*np.meshgrid(np.fft.fftfreq(SIZE_PX), np.fft.fftfreq(SIZE_PX)))
    frequency[0, 0] = np.inf
    shaped = np.fft.ifft2(np.fft.fft2(white) * frequency**-slope).real
    ranks = np.empty(SIZE_PX * SIZE_PX)
    ranks[np.argsort(shaped.ravel(), kind="stable")] = np.linspace(0.0, 1.0, SIZE_PX * SIZE_PX)
    return ranks.reshape(SIZE_PX, SIZE_PX)
