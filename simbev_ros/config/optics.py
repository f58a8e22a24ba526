"""What a camera does with the light of its colour image: exposure, vignetting, noise."""

import math
from typing import Self

from pydantic import Field, model_validator

from simbev_ros.config.base import Model


class Exposure(Model):
    """How bright the colour image is: by the light of the scene, or fixed by aperture, time and ISO.

    With an f-number alone the camera chooses the time, so that the image stays as bright; depth of field is not drawn.
    """

    compensation_ev: float = Field(0.0, ge=-10, le=10, description="stops; positive is brighter")
    f_number: float = Field(1.8, ge=0.5, le=64, description="focal length over aperture")
    time_s: float | None = Field(None, ge=1e-6, le=60, description="with iso: a fixed exposure; None: by the light")
    iso: float | None = Field(None, ge=1, le=1e6, description="with time_s; None: by the light")

    @model_validator(mode="after")
    def _time_with_iso(self) -> Self:
        if (self.time_s is None) != (self.iso is None):
            given, missing = ("time_s", "iso") if self.iso is None else ("iso", "time_s")
            raise ValueError(f"{given} is set, {missing} is not: give both for a fixed exposure, none for an automatic")
        return self

    @property
    def value_ev(self) -> float | None:
        """Exposure value at ISO 100 that these settings are right for (ISO 2720); None if the camera chooses it."""
        if self.time_s is None or self.iso is None:
            return None
        return math.log2(self.f_number**2 / self.time_s * 100.0 / self.iso)


class SensorNoise(Model):
    """Noise of the image sensor, in electrons; darker parts suffer more. ISO above 100 leaves fewer electrons."""

    full_well_electrons: float = Field(
        10000.0, ge=10, le=1e7, description="what white is at ISO 100; shot noise is the square root of the signal"
    )
    read_sigma_electrons: float = Field(3.0, ge=0, le=1e5, description="added at every pixel, even in darkness")


class Optics(Model):
    """The properties of a camera that only its colour image shows. By default it is ideal."""

    exposure: Exposure = Exposure()
    vignetting: float = Field(
        0.0, ge=0, le=4, description="exponent on the law of cos⁴ of the angle to the optical axis; 1 is a simple lens"
    )
    noise: SensorNoise | None = Field(None, description="None: no noise")

    @property
    def white_electrons(self) -> float:
        """Electrons that make a white pixel; infinite without noise."""
        if self.noise is None:
            return math.inf
        return self.noise.full_well_electrons * 100.0 / (self.exposure.iso or 100.0)


IDEAL_OPTICS = Optics()
