"""Radars of a rig: field of view, rays, thresholds, noise and resolution."""

from typing import Any, Literal, Self

from pydantic import Field, ValidationError, model_validator

from simbev_ros.config.base import Model
from simbev_ros.config.presets import filled_in, preset_of, require_known
from simbev_ros.config.sensor import Sensor

RayPattern = Literal["cone", "even"]

_MAX_RAYS = 1_000_000
"""Maximum number of rays per scan; bounds the memory."""
_MAX_CELLS = 1 << 24
"""Maximum number of cells of a detector; bounds the memory."""
_CELLS = ("range_resolution_m", "doppler_resolution_mps", "azimuth_resolution_deg")
_RESOLUTIONS = (*_CELLS, "elevation_resolution_deg")


class RadarDetector(Model):
    """How a product gathers reflections into cells and finds targets in them, up to its number of targets."""

    noise_dbsm: float = Field(
        -15.0, ge=-100, le=100, description="cross-section at reference_range_m that is as strong as a cell's noise"
    )
    threshold_db: float = Field(
        12.0, ge=0, le=60, description="power of a target over the noise and the clutter before or behind it"
    )
    min_rcs_dbsm: float | None = Field(
        None, ge=-100, le=100, description="smallest cross-section of a target at any range; none: no limit"
    )
    clutter_cells: int = Field(8, ge=2, le=128, description="range cells of which clutter is the mean, on each side")
    max_targets: int = Field(256, ge=1, le=100_000, description="maximum number of targets of a scan, the strongest")


class SecondScan(Model):
    """A scan of another field of view in the same cycle. Values that are not given are those of the radar."""

    range_m: float | None = Field(None, gt=0, le=1000, description="maximum range")
    horizontal_fov_deg: float | None = Field(None, gt=0, lt=180, description="horizontal field of view, full angle")
    vertical_fov_deg: float | None = Field(None, gt=0, lt=180, description="vertical field of view, full angle")
    points_per_second: int | None = Field(None, ge=1, le=_MAX_RAYS, description="number of rays per second")
    range_resolution_m: float | None = Field(None, gt=0, le=100, description="cell size")
    doppler_resolution_mps: float | None = Field(None, gt=0, le=100, description="cell size for speeds")
    azimuth_resolution_deg: float | None = Field(None, gt=0, le=90, description="cell size for azimuths")
    range_noise_sigma_m: float | None = Field(None, ge=0, le=100, description="standard deviation per detection")
    azimuth_noise_sigma_deg: float | None = Field(None, ge=0, le=45, description="standard deviation per detection")
    detector: RadarDetector | None = Field(None, description="how targets are found")


class Radar(Sensor):
    """A radar that casts random rays and gives a detection for each ray that returns.

    All effects that degrade the measurement are off by default, as in the paper.
    """

    type: Literal["radar"]
    preset: str | None = Field(
        None, description="a manufacturer's model, which provides the values that are not given here"
    )
    range_m: float = Field(120.0, gt=0, le=1000, description="maximum range")
    min_range_m: float = Field(
        0.0, ge=0, le=1000, description="minimum range; nearer surfaces are not detected but occlude"
    )
    horizontal_fov_deg: float = Field(100.0, gt=0, lt=180, description="horizontal field of view, full angle")
    vertical_fov_deg: float = Field(12.0, gt=0, lt=180, description="vertical field of view, full angle")
    points_per_second: int = Field(
        40_000, ge=1, le=_MAX_RAYS, description="number of rays per second, at least one per scan"
    )
    ray_pattern: RayPattern = Field(
        "cone",
        description="distribution of rays; cone: elliptic and denser towards the axis, as in CARLA; "
        "even: uniform density over the whole field of view, including its corners",
    )
    micro_doppler: bool = Field(False, description="whether wheels and limbs have speeds of their own")

    reference_range_m: float = Field(
        100.0, gt=0, le=10_000, description="range at which 1 m² of cross-section returns an amplitude of 0 dB"
    )
    threshold_db: float | None = Field(
        None, ge=-300, le=300, description="minimum amplitude of a detection; none: no limit"
    )
    rain_attenuation: bool = Field(False, description="whether rain weakens returns, by up to 1.5 dB at 100 m")

    range_noise_sigma_m: float = Field(0.0, ge=0, le=100, description="standard deviation per detection")
    azimuth_noise_sigma_deg: float = Field(0.0, ge=0, le=45, description="standard deviation per detection")
    elevation_noise_sigma_deg: float = Field(0.0, ge=0, le=45, description="standard deviation per detection")
    doppler_noise_sigma_mps: float = Field(0.0, ge=0, le=100, description="standard deviation per detection")
    amplitude_noise_sigma_db: float = Field(
        0.0, ge=0, le=50, description="standard deviation per detection, before the threshold"
    )

    max_doppler_mps: float | None = Field(
        None,
        gt=0,
        le=1000,
        description="unambiguous speed; higher speeds are aliased into ± this value; none: no limit",
    )
    range_resolution_m: float | None = Field(
        None, gt=0, le=100, description="cell size; ranges are rounded to the centers of cells; none: not rounded"
    )
    doppler_resolution_mps: float | None = Field(
        None, gt=0, le=100, description="cell size for speeds, with a cell centered at 0; none: not rounded"
    )
    azimuth_resolution_deg: float | None = Field(
        None, gt=0, le=90, description="cell size for azimuths, with a cell centered at 0; none: not rounded"
    )
    elevation_resolution_deg: float | None = Field(
        None, gt=0, le=90, description="cell size for elevations, with a cell centered at 0; none: not rounded"
    )
    one_per_cell: bool = Field(
        False, description="whether only the strongest detection in each cell of all four resolutions is given"
    )

    measures_elevation: bool = Field(True, description="whether elevations are measured; otherwise they are 0")
    detector: RadarDetector | None = Field(
        None,
        description="targets are found in cells of the resolutions, from rays over all of the field of view; "
        "none: each ray is a detection",
    )
    ghosts: bool = Field(
        False, description="whether a detector also finds objects where walls and guard rails mirror them"
    )
    second_scan: SecondScan | None = Field(
        None, description="a scan of another field of view, whose detections follow in the same cloud"
    )
    scan: bool = Field(
        False, description="whether detections are also sent as radar_msgs/RadarScan, on the topic scan beside points"
    )

    @property
    def scans_of_cycle(self) -> tuple["Radar", ...]:
        """The scans of a cycle as a radar each: this one, and the second scan if there is one."""
        if self.second_scan is None:
            return (self,)
        own = self.model_dump(exclude={"preset", "second_scan"})
        second = Radar.model_validate(own | self.second_scan.model_dump(exclude_none=True))
        return self, second.model_copy(update={"name": f"{self.name}/second_scan"})

    def _require_cells(self) -> None:
        """Check that the detector's cells are given, and that memory has room for them."""
        range_m, speed_mps, azimuth_deg = (
            self.range_resolution_m,
            self.doppler_resolution_mps,
            self.azimuth_resolution_deg,
        )
        if missing := [name for name in (*_CELLS, "max_doppler_mps") if getattr(self, name) is None]:
            raise ValueError(f"detector: cells need {', '.join(missing)} too")
        assert range_m and speed_mps and azimuth_deg and self.max_doppler_mps
        cells = self.range_m / range_m * 2.0 * self.max_doppler_mps / speed_mps * self.horizontal_fov_deg / azimuth_deg
        if cells > _MAX_CELLS:
            raise ValueError(
                f"detector: {cells:.0f} cells of range, speed and azimuth; at most {_MAX_CELLS} are allowed"
            )

    @model_validator(mode="before")
    @classmethod
    def _fill_in(cls, data: Any) -> Any:
        """Fill in the values of a preset."""
        return filled_in(data, preset_of("radar", data)) if isinstance(data, dict) else data

    @model_validator(mode="after")
    def _known_preset(self) -> Self:
        require_known("radar", self.preset)
        return self

    @model_validator(mode="after")
    def _fields_agree(self) -> Self:
        if self.min_range_m >= self.range_m:
            raise ValueError(f"min_range_m {self.min_range_m:g} is not below range_m {self.range_m:g}")
        if self.rate_hz is not None and self.points_per_second > _MAX_RAYS * self.rate_hz:
            raise ValueError(
                f"points_per_second {self.points_per_second} at rate_hz {self.rate_hz:g} are "
                f"{self.points_per_second / self.rate_hz:.0f} rays a scan; at most {_MAX_RAYS} are allowed"
            )
        if self.detector is not None:
            self._require_cells()
        if self.detector is not None and (self.ray_pattern != "even" or self.one_per_cell):
            raise ValueError("detector: needs ray_pattern even, without one_per_cell")
        if self.ghosts and self.detector is None:
            raise ValueError("ghosts: need a detector")
        if self.one_per_cell and (missing := [name for name in _RESOLUTIONS if getattr(self, name) is None]):
            raise ValueError(f"one_per_cell: cells need {', '.join(missing)} too")
        return self

    @model_validator(mode="after")
    def _second_scan_is_valid(self) -> Self:
        if self.second_scan is not None and self.second_scan.detector is not None and self.detector is None:
            raise ValueError("second_scan: detector: the radar has none")
        try:
            assert self.scans_of_cycle
        except ValidationError as error:
            raise ValueError(f"second_scan: {error.errors()[0]['msg'].removeprefix('Value error, ')}") from None
        return self
