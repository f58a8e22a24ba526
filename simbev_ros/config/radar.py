"""Radars."""

from typing import Literal, Self

from pydantic import Field, model_validator

from simbev_ros.config.sensor import Sensor

RayPattern = Literal["cone", "even"]

_MOST_RAYS = 1_000_000
"""Of a scan; bounds its memory."""
_RESOLUTIONS = ("range_resolution_m", "doppler_resolution_mps", "azimuth_resolution_deg", "elevation_resolution_deg")


class Radar(Sensor):
    """A radar that sees what random rays hit: one detection for each ray that returns.

    Everything that degrades the measurement is off by default, as in the paper.
    """

    type: Literal["radar"]
    range_m: float = Field(120.0, gt=0, le=1000, description="maximum range")
    min_range_m: float = Field(0.0, ge=0, le=1000, description="what is nearer is not detected, but hides what follows")
    horizontal_fov_deg: float = Field(100.0, gt=0, lt=180, description="full angle")
    vertical_fov_deg: float = Field(12.0, gt=0, lt=180, description="full angle")
    points_per_second: int = Field(40_000, ge=1, le=_MOST_RAYS, description="rays; there is at least one per scan")
    ray_pattern: RayPattern = Field(
        "cone",
        description="cone: elliptic and denser towards its axis, as in CARLA; "
        "even: the same density in all directions of the field of view, to its corners",
    )
    micro_doppler: bool = Field(False, description="wheels and limbs have their own motion, not that of the body")

    reference_range_m: float = Field(
        100.0, gt=0, le=10_000, description="amplitude 0 dB is what 1 m² of cross-section returns from this range"
    )
    threshold_db: float | None = Field(None, ge=-300, le=300, description="what returns less amplitude is not detected")
    rain_attenuation: bool = Field(False, description="rain weakens what returns: 1.5 dB at 100 m in the heaviest")

    range_noise_sigma_m: float = Field(0.0, ge=0, le=100, description="of each detection")
    azimuth_noise_sigma_deg: float = Field(0.0, ge=0, le=45, description="of each detection")
    elevation_noise_sigma_deg: float = Field(0.0, ge=0, le=45, description="of each detection")
    doppler_noise_sigma_mps: float = Field(0.0, ge=0, le=100, description="of each detection")
    amplitude_noise_sigma_db: float = Field(0.0, ge=0, le=50, description="of each detection; before the threshold")

    max_doppler_mps: float | None = Field(
        None, gt=0, le=1000, description="speeds beyond it are aliased into ± this; none: every speed is measured"
    )
    range_resolution_m: float | None = Field(None, gt=0, le=100, description="ranges are the middles of such cells")
    doppler_resolution_mps: float | None = Field(None, gt=0, le=100, description="as range_resolution_m; a cell at 0")
    azimuth_resolution_deg: float | None = Field(None, gt=0, le=90, description="as doppler_resolution_mps")
    elevation_resolution_deg: float | None = Field(None, gt=0, le=90, description="as doppler_resolution_mps")
    one_per_cell: bool = Field(
        False, description="of detections in one cell of all four resolutions only the strongest is given"
    )

    @model_validator(mode="after")
    def _fields_agree(self) -> Self:
        if self.min_range_m >= self.range_m:
            raise ValueError(f"min_range_m {self.min_range_m:g} is not below range_m {self.range_m:g}")
        if self.rate_hz is not None and self.points_per_second > _MOST_RAYS * self.rate_hz:
            raise ValueError(
                f"points_per_second {self.points_per_second} at rate_hz {self.rate_hz:g} are "
                f"{self.points_per_second / self.rate_hz:.0f} rays a scan; at most {_MOST_RAYS} are allowed"
            )
        if self.one_per_cell and (missing := [name for name in _RESOLUTIONS if getattr(self, name) is None]):
            raise ValueError(f"one_per_cell: cells need {', '.join(missing)} too")
        return self
