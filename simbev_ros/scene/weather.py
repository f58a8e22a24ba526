"""Weather and light of one moment, in CARLA's units."""

import numpy as np
from pydantic import BaseModel, ConfigDict, Field


class Weather(BaseModel):
    """Fully drawn weather; the ranges are those of the paper's table."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    cloudiness: float = Field(ge=0, le=100)
    precipitation: float = Field(ge=0, le=100)
    precipitation_deposits: float = Field(ge=0, le=100, description="puddles")
    wetness: float = Field(ge=0, le=100, description="camera blur in rain")
    wind_intensity: float = Field(ge=0, le=100)
    sun_azimuth_deg: float = Field(ge=0, le=360, description="counter-clockwise from the map's x axis")
    sun_altitude_deg: float = Field(ge=-90, le=90)
    fog_density: float = Field(ge=0, le=100)
    fog_distance_m: float = Field(ge=0, description="where fog starts")
    fog_falloff: float = Field(ge=0, description="0 fills all heights, 1 about air, > 5 hugs the ground")

    def towards(self, other: "Weather", share: float) -> "Weather":
        """The weather after a share, in 0..1, of the straight way to another; the sun goes round the shorter way."""
        start, end = (np.array(list(each.model_dump().values())) for each in (self, other))
        turn = list(type(self).model_fields).index("sun_azimuth_deg")
        end[turn] = start[turn] + (end[turn] - start[turn] + 180.0) % 360.0 - 180.0
        # Clipped, because rounding may leave the range by the last digit.
        now = np.clip(start * (1.0 - share) + end * share, np.minimum(start, end), np.maximum(start, end))
        now[turn] %= 360.0
        return Weather(**dict(zip(type(self).model_fields, now.tolist(), strict=True)))
