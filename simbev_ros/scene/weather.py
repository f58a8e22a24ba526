"""Weather and light of one moment, in CARLA's units."""

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
