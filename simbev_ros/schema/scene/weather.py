"""Weather and sun of one moment, in CARLA's units."""

import numpy as np
from pydantic import BaseModel, ConfigDict, Field


class Weather(BaseModel):
    """Fully drawn weather; the ranges are those of the table in the SimBEV paper."""

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
    fog_falloff: float = Field(ge=0, description="0: uniform with height; 1: about like air; > 5: fog hugs the ground")

    def sheltered(self) -> "Weather":
        """The weather without rain, fog and wet ground, as it is in a tunnel."""
        clear = dict.fromkeys(("precipitation", "precipitation_deposits", "wetness", "fog_density"), 0.0)
        return self.model_copy(update=clear)

    def interpolate(self, other: "Weather", fraction: float) -> "Weather":
        """Weather at a fraction, 0 to 1, of a linear transition; the sun's azimuth takes the shorter way around."""
        start, end = (np.array(list(each.model_dump().values())) for each in (self, other))
        azimuth = list(type(self).model_fields).index("sun_azimuth_deg")
        end[azimuth] = start[azimuth] + (end[azimuth] - start[azimuth] + 180.0) % 360.0 - 180.0
        # Clipped, because rounding may exceed the range in the last digit.
        now = np.clip(start * (1.0 - fraction) + end * fraction, np.minimum(start, end), np.maximum(start, end))
        now[azimuth] %= 360.0
        return Weather(**dict(zip(type(self).model_fields, now.tolist(), strict=True)))
