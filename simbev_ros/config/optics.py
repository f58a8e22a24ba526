"""Optical properties of a camera: exposure, shutter, vignetting and noise."""

import math
from typing import Self

from pydantic import Field, model_validator

from simbev_ros.config.base import Model


class Exposure(Model):
    """Brightness of the color image: automatic by the light of the scene, or fixed by aperture, time and ISO.

    With an f-number alone the camera chooses the time, so the brightness stays the same; depth of field is not
    simulated.
    """

    compensation_ev: float = Field(
        0.0, ge=-10, le=10, description="exposure compensation in stops; positive is brighter"
    )
    f_number: float = Field(1.8, ge=0.5, le=64, description="focal length divided by aperture diameter")
    time_s: float | None = Field(None, ge=1e-6, le=60, description="exposure time, with iso; none: automatic")
    iso: float | None = Field(None, ge=1, le=1e6, description="ISO sensitivity, with time_s; none: automatic")

    @model_validator(mode="after")
    def _time_with_iso(self) -> Self:
        if (self.time_s is None) != (self.iso is None):
            given, missing = ("time_s", "iso") if self.iso is None else ("iso", "time_s")
            raise ValueError(f"{given} is set, {missing} is not: give both for a fixed exposure, none for an automatic")
        return self

    @property
    def value_ev(self) -> float | None:
        """Exposure value at ISO 100 for which these settings are correct (ISO 2720); None if exposure is automatic."""
        if self.time_s is None or self.iso is None:
            return None
        return math.log2(self.f_number**2 / self.time_s * 100.0 / self.iso)


class SensorNoise(Model):
    """Noise of the image sensor, in electrons; it is stronger in dark areas and, for ISO above 100, everywhere."""

    full_well_electrons: float = Field(
        10000.0,
        ge=10,
        le=1e7,
        description="signal of a white pixel at ISO 100; shot noise is the square root of the signal",
    )
    read_sigma_electrons: float = Field(
        3.0, ge=0, le=1e5, description="standard deviation of read noise, added to every pixel"
    )


class Shutter(Model):
    """Shutter of an imager: when and for how long its rows are exposed, which blurs and shears what moves.

    The stamp of an image is the middle of the exposure of its middle row, so that labels of that moment fit best. A
    driver that stamps the trigger, as in nuScenes, is earlier by half the exposure time and half the readout.
    """

    max_time_s: float = Field(
        0.02,
        ge=1e-6,
        le=1,
        description="maximum exposure time of automatic exposure; with less light, signals and noise are amplified",
    )
    iso: float = Field(200.0, ge=1, le=1e6, description="ISO sensitivity without amplification")
    readout_s: float = Field(
        0.0,
        ge=0,
        le=0.1,
        description="time from the first row to the last; in all images of the camera, each row is of its own time; "
        "0: global shutter",
    )


class Imager(Model):
    """Lens and image sensor as they are sold: light becomes electrons, a mosaic of colors, and a picture again."""

    blur_px: float = Field(
        0.5, ge=0, le=20, description="standard deviation of the point spread of lens and pixel, in pixels"
    )
    metered: float = Field(
        0.2,
        gt=0,
        lt=1,
        description="mean that metering gives the light, as a share of white; sky and lamps beyond white are clipped",
    )
    glare: float = Field(0.01, ge=0, le=0.5, description="share of the light that lens and cover scatter widely")
    lateral_color_px: float = Field(
        0.0, ge=-20, le=20, description="how far red lies outside green in the corners, and blue inside"
    )
    full_well_electrons: float = Field(10000.0, ge=10, le=1e7, description="electrons of a white pixel")
    read_sigma_electrons: float = Field(3.0, ge=0, le=1e5, description="standard deviation of read noise")
    bits: int = Field(12, ge=8, le=16, description="bits of a raw value")
    shutter: Shutter | None = Field(
        None, description="exposure time and rows; none: each image shows one moment, at a fixed sensitivity"
    )
    white_balance: tuple[float, float] = Field(
        (1.0, 1.0), description="factors on red and blue after demosaicing; more than 1 is warmer, and bluer"
    )
    saturation: float = Field(1.0, ge=0, le=4, description="factor on the distance of colors from gray")
    contrast: float = Field(0.0, ge=0, le=1, description="strength of the curve that darkens shadows after gamma")
    sharpening: float = Field(0.0, ge=0, le=4, description="amount of unsharp masking")
    jpeg_quality: int | None = Field(
        None, ge=1, le=100, description="quality of the camera's JPEG; none: recording.jpeg_quality"
    )

    @model_validator(mode="after")
    def _positive_balance(self) -> Self:
        if min(self.white_balance) <= 0.0 or max(self.white_balance) > 8.0:
            raise ValueError(f"white_balance {list(self.white_balance)}: each above 0, at most 8")
        return self


class Optics(Model):
    """Optical properties of a camera that affect only its color image; ideal by default."""

    exposure: Exposure = Exposure()
    vignetting: float = Field(
        0.0, ge=0, le=4, description="exponent on cos⁴ of the angle to the optical axis; 0: none, 1: a simple lens"
    )
    noise: SensorNoise | None = Field(None, description="noise of the image sensor; none: no noise")
    imager: Imager | None = Field(
        None, description="lens and image sensor of a product, in place of noise; none: as in the paper"
    )

    @model_validator(mode="after")
    def _noise_once(self) -> Self:
        if self.noise is not None and self.imager is not None:
            raise ValueError("noise and imager are set: give one or the other")
        return self

    @property
    def white_electrons(self) -> float:
        """Number of electrons of a white pixel; infinite without noise."""
        if self.noise is None:
            return math.inf
        return self.noise.full_well_electrons * 100.0 / (self.exposure.iso or 100.0)


IDEAL_OPTICS = Optics()
