"""Lidars."""

from typing import Literal, Self

from pydantic import Field, model_validator

from simbev_ros.config.sensor import Sensor


class Lidar(Sensor):
    """A rotating lidar, and the noise-free semantic lidar with the same rays."""

    type: Literal["lidar"]
    channels: int = Field(128, ge=1, le=1024)
    columns: int = Field(2048, ge=1, le=16384, description="firings per turn")
    range_m: float = Field(120.0, gt=0, le=1000)
    upper_fov_deg: float = Field(10.67, ge=-90, le=90)
    lower_fov_deg: float = Field(-30.67, ge=-90, le=90)
    drop_off: float = Field(0.14, ge=0, le=1, description="share of returns lost at random")
    range_noise_sigma_m: float = Field(0.01, ge=0, le=10)
    points: bool = Field(True, description="publish points (with drop-off and noise)")
    semantic_points: bool = Field(True, description="publish semantic_points (neither)")

    @model_validator(mode="after")
    def _fields_of_view(self) -> Self:
        if self.lower_fov_deg > self.upper_fov_deg:
            raise ValueError(f"lower_fov_deg {self.lower_fov_deg} is above upper_fov_deg {self.upper_fov_deg}")
        if not (self.points or self.semantic_points):
            raise ValueError("points and semantic_points are both off: the lidar would publish nothing")
        return self
