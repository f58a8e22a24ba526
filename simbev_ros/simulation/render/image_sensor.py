"""Forms a color image as a camera that is sold does: lens, exposure, image sensor, demosaicing, and what follows.

``expose``: the ideal image is decoded to light by the inverse of its film curve. The lens darkens the corners, spreads
each point (a Gaussian), magnifies red more than blue, and scatters a share of all light widely. Each pixel has one of
the colors of the mosaic RGGB. Metering brings the mean of the light to a share of white, so that sky and lamps can be
beyond white: the pixels' wells are full there. Electrons have shot noise and read noise.

``develop``: the picture is interpolated from the mosaic (OpenCV, edge-aware), balanced, saturated, coded with sRGB's
curve, and sharpened.
"""

import math
from dataclasses import replace
from functools import lru_cache

import cv2
import numpy as np

from simbev_ros.config.optics import Imager
from simbev_ros.foundation.geometry.camera import PinholeCamera
from simbev_ros.foundation.geometry.fisheye import FisheyeCamera
from simbev_ros.foundation.types import Float32Array, Float64Array, UInt8Array, UInt16Array
from simbev_ros.simulation.render.frame import CameraImages, CameraView

_LUMA = np.array([0.2126, 0.7152, 0.0722], np.float32)
_WIDE_SHARE = 0.08  # standard deviation of scattered light, as a share of the image's width
_SMALL_PX = 64  # width of the image in which scattered light is spread
_METERING_STEPS = 12
_METERING_PX = 8  # distance of the pixels that are metered
_UNSHARP_SIGMA_PX = 1.0
_KERNEL_SIGMAS = 2.5
_FIELD_MARGIN_PX = 256


def form_images(view: CameraView, images: CameraImages, amplification: float = 1.0) -> CameraImages:
    """The images of a view whose color image is still that of an ideal camera; without an imager, it stays so.

    Amplification after the pixels is the factor by which fewer electrons are white.
    """
    imager = view.optics.imager
    if imager is None or images.rgb is None:
        return images
    darkens = view.optics.vignetting or isinstance(view.camera, FisheyeCamera)
    falloff = _falloff(view.camera, view.optics.vignetting) if darkens else None
    if amplification != 1.0:
        imager = imager.model_copy(update={"full_well_electrons": imager.full_well_electrons / amplification})
    mosaic = expose(images.rgb, imager, view.noise_seed, falloff)
    return replace(
        images,
        rgb=develop(mosaic, imager) if "rgb" in view.modalities else None,
        raw=(mosaic >> (imager.bits - 8)).astype(np.uint8) if "raw" in view.modalities else None,
    )


def expose(rgb: UInt8Array, imager: Imager, noise_seed: int, falloff: Float32Array | None = None) -> UInt16Array:
    """Raw values of a camera.

    Args:
        rgb: (H, W, 3) image of an ideal camera.
        imager: The camera.
        noise_seed: Seed of the noise.
        falloff: (H, W, 3) share of the light that the lens lets pass, not metered where it is 0; None: all of it.

    Returns:
        (H, W) mosaic, red at even rows and columns, blue at odd ones; of ``imager.bits`` bits.
    """
    light = np.asarray(cv2.LUT(rgb, _light_by_gray()), np.float32)
    if falloff is not None:
        light *= falloff
    if imager.blur_px > 0.0:
        light = _blurred(light, imager.blur_px)
    if imager.lateral_color_px != 0.0:
        light = _dispersed(light, imager.lateral_color_px)
    mosaic = _mosaic(light)
    if imager.glare > 0.0:
        mosaic = _scattered(mosaic, light, imager.glare)
    metered = light[::_METERING_PX, ::_METERING_PX]
    if falloff is not None:
        metered = metered[falloff[::_METERING_PX, ::_METERING_PX, 0] > 0.0]
    mosaic *= np.float32(_metering_gain(metered, imager.metered) * imager.full_well_electrons)
    return _read_out(mosaic, imager, noise_seed)


def develop(mosaic: UInt16Array, imager: Imager) -> UInt8Array:
    """(H, W, 3) color image of a camera from its (H, W) raw values."""
    picture = cv2.demosaicing(mosaic, cv2.COLOR_BayerBG2RGB_EA)  # OpenCV names mosaics by their second row
    if (colors := _color_matrix(imager)) is not None:
        picture = cv2.transform(picture, colors)
    image: UInt8Array = _gray_by_value(imager.bits, imager.contrast)[picture]
    if imager.sharpening > 0.0:
        soft = cv2.GaussianBlur(image, (0, 0), _UNSHARP_SIGMA_PX)
        image = np.asarray(cv2.addWeighted(image, 1.0 + imager.sharpening, soft, -imager.sharpening, 0.0), np.uint8)
    return image


@lru_cache(maxsize=1)
def _light_by_gray() -> Float32Array:
    """(256,) light of the gray levels of ideal images: the inverse of the film curve in film.glsl."""
    filmic = (np.arange(256) / 255.0) ** 2.2
    a, b, c = 2.51 - 2.43 * filmic, 0.59 * filmic - 0.03, 0.14 * filmic
    return ((b + np.sqrt(b * b + 4.0 * a * c)) / (2.0 * a)).astype(np.float32)


@lru_cache(maxsize=16)
def _falloff(camera: PinholeCamera, exponent: float) -> Float32Array:
    """(H, W, 3) share of the light that passes the lens: an exponent on its relative illumination."""
    rows, columns = np.mgrid[: camera.height_px, : camera.width_px]
    rays = camera.rays(np.stack([columns.ravel(), rows.ravel()], axis=1))
    illumination = np.nan_to_num(camera.relative_illumination(rays))  # a fisheye sees nothing outside its image circle
    share = np.where(illumination > 0.0, illumination**exponent, 0.0).astype(np.float32).reshape(rows.shape)
    return np.repeat(share[..., None], 3, axis=2)


def _blurred(light: Float32Array, sigma_px: float) -> Float32Array:
    side = 2 * math.ceil(_KERNEL_SIGMAS * sigma_px) + 1
    return np.asarray(cv2.GaussianBlur(light, (side, side), sigma_px), np.float32)


def _mosaic(light: Float32Array) -> Float32Array:
    """(H, W) light of the mosaic: red at even rows and columns, blue at odd ones."""
    mosaic = light[..., 1].copy()
    mosaic[::2, ::2], mosaic[1::2, 1::2] = light[::2, ::2, 0], light[1::2, 1::2, 2]
    return mosaic


def _scattered(mosaic: Float32Array, light: Float32Array, share: float) -> Float32Array:
    """The mosaic with a share of its light spread; what is spread is smooth, so that half the resolution will do."""
    height, width = mosaic.shape
    small = cv2.resize(
        light[::2, ::2], (_SMALL_PX, max(1, round(_SMALL_PX * height / width))), interpolation=cv2.INTER_AREA
    )
    wide = cv2.GaussianBlur(small, (0, 0), _WIDE_SHARE * _SMALL_PX) * np.float32(share)
    red, green, blue = cv2.split(cv2.resize(wide, ((width + 1) // 2, (height + 1) // 2)))
    mosaic *= np.float32(1.0 - share)
    for row, column, plane in ((0, 0, red), (0, 1, green), (1, 0, green), (1, 1, blue)):
        part = mosaic[row::2, column::2]
        part += plane[: part.shape[0], : part.shape[1]]
    return mosaic


def _dispersed(light: Float32Array, corner_px: float) -> Float32Array:
    height, width = light.shape[:2]
    center_px = np.array([width - 1, height - 1]) / 2.0
    planes = list(cv2.split(light))
    for plane, sign in ((0, 1.0), (2, -1.0)):
        scale = 1.0 + sign * corner_px / float(np.hypot(*center_px))
        matrix = np.column_stack([scale * np.eye(2), (1.0 - scale) * center_px])
        planes[plane] = cv2.warpAffine(planes[plane], matrix, (width, height), borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(cv2.merge(planes), np.float32)


def _metering_gain(light: Float32Array, target: float) -> float:
    """Factor by which the mean of the light, clipped at white, is the target; colors are the last axis."""
    bright = light @ _LUMA
    low, high = 1e-3, 1e3
    for _ in range(_METERING_STEPS):
        middle = float(np.sqrt(low * high))
        low, high = (middle, high) if np.minimum(middle * bright, 1.0).mean() < target else (low, middle)
    return float(np.sqrt(low * high))


def _read_out(electrons: Float32Array, imager: Imager, noise_seed: int) -> UInt16Array:
    """(H, W) raw values of the mean numbers of electrons in the pixels' wells."""
    deviation = np.asarray(cv2.sqrt(electrons + np.float32(imager.read_sigma_electrons**2)), np.float32)
    electrons += deviation * _deviates(electrons.shape, noise_seed)
    most = (1 << imager.bits) - 1
    raw: UInt16Array = np.clip(np.rint(electrons * (most / imager.full_well_electrons)), 0, most).astype(np.uint16)
    return raw


def _deviates(shape: tuple[int, ...], seed: int) -> Float32Array:
    """(H, W) normal deviates: a part of a larger field, at a place and with a sign that follow from the seed."""
    field = _deviate_field(shape[0], shape[1])
    rng = np.random.Generator(np.random.PCG64(seed))
    row, column, flips = rng.integers((_FIELD_MARGIN_PX + 1, _FIELD_MARGIN_PX + 1, 8))
    part = field[row : row + shape[0], column : column + shape[1]]
    part = part[:: 1 - 2 * int(flips & 1), :: 1 - (int(flips) & 2)]
    return -part if flips & 4 else part


@lru_cache(maxsize=4)
def _deviate_field(height: int, width: int) -> Float32Array:
    """Drawn once, because drawing deviates takes as long as all else that forms an image."""
    size = height + _FIELD_MARGIN_PX, width + _FIELD_MARGIN_PX
    return np.random.Generator(np.random.PCG64(0)).standard_normal(size, np.float32)


def _color_matrix(imager: Imager) -> Float64Array | None:
    """(3, 3) balance, then saturation; None if neither changes anything."""
    if imager.white_balance == (1.0, 1.0) and imager.saturation == 1.0:
        return None
    red, blue = imager.white_balance
    gray = np.tile(_LUMA.astype(np.float64), (3, 1))
    return (gray + imager.saturation * (np.eye(3) - gray)) @ np.diag([red, 1.0, blue])


@lru_cache(maxsize=4)
def _gray_by_value(bits: int, contrast: float) -> UInt8Array:
    """(65536,) gray levels of values, by sRGB's curve and one that darkens shadows and brightens lights."""
    share = np.minimum(np.arange(1 << 16) / ((1 << bits) - 1), 1.0)
    curve = np.where(share <= 0.0031308, 12.92 * share, 1.055 * share ** (1.0 / 2.4) - 0.055)
    curve = (1.0 - contrast) * curve + contrast * curve * curve * (3.0 - 2.0 * curve)
    return np.rint(255.0 * curve).astype(np.uint8)
