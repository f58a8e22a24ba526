"""Rotating lidars of a rig: ray directions, ranges, noise, losses and weather effects."""

from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from simbev_ros.config.base import Model
from simbev_ros.config.presets import filled_in, preset_of, require_known
from simbev_ros.config.sensor import Sensor

_Elevation = Annotated[float, Field(ge=-90, le=90)]
_AzimuthOffset = Annotated[float, Field(ge=-180, le=180)]
_Delay = Annotated[float, Field(ge=0, le=1000)]
_BY_CHANNEL = ("azimuth_offsets_deg", "channel_delays_us")
_VERTICAL = ("channels", "upper_fov_deg", "lower_fov_deg", "elevations_deg", *_BY_CHANNEL)
_TOLERANCE_DEG = 1e-6
_MAX_RAYS = 4_000_000
"""Maximum number of rays per turn; bounds the memory."""


class Receiver(Model):
    """How a product detects echoes by their received power, and which intensity it writes for them."""

    range_at_10_percent_m: float = Field(
        gt=0, le=1000, description="range at which half of the pulses on a matte surface of 10 % reflectance return"
    )
    spread_db: float = Field(
        1.0, ge=0, le=10, description="standard deviation of the received power from pulse to pulse"
    )
    channel_spread_db: float = Field(
        0.0, ge=0, le=10, description="standard deviation of the gain from channel to channel, the same in all scenes"
    )
    near_field_m: float = Field(
        0.0, ge=0, le=50, description="range up to which the receiver sees less than 63 % of its beam; 0: all of it"
    )
    pulse_m: float = Field(
        0.75, gt=0, le=10, description="half the length of a pulse; echoes closer together are one, at their mean range"
    )
    noise_at_threshold_m: float = Field(
        0.0, ge=0, le=10, description="standard deviation of ranges of the weakest echoes, beside range_noise_sigma_m"
    )
    gain_step_db: float | None = Field(
        None,
        gt=0,
        le=60,
        description="rise of the received power from one pulse of a channel to the next at which half of the pulses "
        "are lost, because the gain follows slowly; none: it follows at once",
    )
    gain_spread_db: float = Field(
        1.8, gt=0, le=60, description="scale of the logistic function of this rise, which is the share of lost pulses"
    )
    scale: Literal["reflectance", "decibel"] = Field(
        "reflectance",
        description="what intensity follows; reflectance: that of the surface, retroreflectors above white; "
        "decibel: the received power's logarithm",
    )
    white: float = Field(
        100 / 255, gt=0, le=1, description="intensity of a white matte surface; on the scale decibel at reference_m"
    )
    reference_m: float = Field(10.0, gt=0, le=1000, description="range of white on the scale decibel")
    per_db: float = Field(0.02, gt=0, le=1, description="intensity for each decibel on the scale decibel")
    floor: float = Field(0.0, ge=0, le=1, description="intensity below which the lidar writes 0")
    steps: int = Field(255, ge=1, le=65535, description="number of steps of intensity from 0 to 1")


class Rosette(Model):
    """How a mirror moves the beams of a lidar whose scans do not repeat: two rates without a common period."""

    turns_hz: float = Field(gt=0, le=10_000, description="rate at which the azimuth of the beams turns")
    nods_hz: float = Field(gt=0, le=10_000, description="rate at which their elevation swings between its limits")


class Lidar(Sensor):
    """A rotating lidar, and an ideal semantic lidar with the same rays.

    A point cloud is one turn, so ``rate_hz`` is the rate of rotation. Defaults follow the paper.
    """

    type: Literal["lidar"]
    preset: str | None = Field(
        None, description="a manufacturer's model, which provides the values that are not given here"
    )
    channels: int = Field(
        128, ge=1, le=1024, description="number of rays per column, evenly spaced from lower_fov_deg to upper_fov_deg"
    )
    columns: int = Field(
        2048, ge=1, le=16384, description="number of firings per turn, evenly spaced over horizontal_fov_deg"
    )
    points_per_second: int | None = Field(
        None,
        ge=1,
        le=10**9,
        description="channels x columns x rate_hz; determines columns if they are not given",
    )
    range_m: float = Field(120.0, gt=0, le=1000, description="maximum range")
    min_range_m: float = Field(0.0, ge=0, le=100, description="minimum range; nearer surfaces give no return")
    upper_fov_deg: float = Field(10.67, ge=-90, le=90, description="elevation of the highest channel")
    lower_fov_deg: float = Field(-30.67, ge=-90, le=90, description="elevation of the lowest channel")
    horizontal_fov_deg: float = Field(
        360.0, gt=0, le=360, description="horizontal field of view, half of it on each side of the x axis"
    )
    elevations_deg: tuple[_Elevation, ...] | None = Field(
        None, min_length=1, max_length=1024, description="elevation of each channel, in the order of ring numbers"
    )
    azimuth_offsets_deg: tuple[_AzimuthOffset, ...] | None = Field(
        None, description="azimuth of each channel relative to its column, positive to the left"
    )
    rosette: Rosette | None = Field(
        None,
        description="scan that does not repeat: azimuths turn while elevations swing from lower_fov_deg to "
        "upper_fov_deg and back, each channel at its own phase; none: every turn is the same",
    )
    azimuth_resolution_deg: float = Field(
        0.0, ge=0, le=10, description="step in which the lidar measures the azimuth of its columns; 0: exact"
    )
    channel_delays_us: tuple[_Delay, ...] | None = Field(
        None,
        description="time from the first firing of a column to that of each channel, in the order of ring numbers, "
        "if rolling; none: all at once",
    )
    drop_off: float = Field(0.14, ge=0, le=1, description="share of all returns that are lost at random")
    drop_off_intensity_limit: float = Field(
        0.8, gt=0, le=1, description="intensity from which on drop_off_at_zero_intensity has no effect"
    )
    drop_off_at_zero_intensity: float = Field(
        0.0,
        ge=0,
        le=1,
        description="share of returns lost at zero intensity, decreasing linearly to 0 at drop_off_intensity_limit",
    )
    range_noise_sigma_m: float = Field(0.01, ge=0, le=10, description="standard deviation of measured ranges")
    attenuation_per_m: float = Field(0.004, ge=0, le=1, description="attenuation of the intensity in clear air")
    receiver: Receiver | None = Field(
        None,
        description="received power by material, angle, range and edges in the beam decides what returns, "
        "in place of attenuation_per_m; none: as in the paper",
    )
    returns: Literal["strongest", "last", "dual"] = Field(
        "strongest", description="echoes that a ray returns, with a receiver; dual: the strongest and the last one"
    )
    weather_effects: bool = Field(True, description="whether rain and fog weaken returns and drops cause echoes")
    beam_divergence_mrad: float = Field(
        3.0, gt=0, le=50, description="full beam angle; wider beams detect fewer single drops"
    )
    rolling: bool = Field(False, description="whether each column is cast at its own time; else all at the stamp")
    hits_own_vehicle: bool = Field(
        False, description="whether rays also hit the vehicle that carries the lidar, and its rider"
    )
    points: bool = Field(True, description="whether to publish points (with drop-off, noise and weather)")
    semantic_points: bool = Field(True, description="whether to publish semantic_points (without these effects)")
    compression: Literal["zstd"] | None = Field(
        None,
        exclude_if=lambda value: value is None,
        description="clouds also as point_cloud_interfaces/CompressedPointCloud2, on the topics points/zstd and "
        "semantic_points/zstd, which bags contain in place of the others; none: no compressed clouds",
    )

    @model_validator(mode="before")
    @classmethod
    def _fill_in(cls, data: Any) -> Any:
        """Fill in the values that follow from a preset, listed elevations and points per second."""
        if not isinstance(data, dict):
            return data
        data = filled_in(data, _preset_for(data, preset_of("lidar", data)))
        listed = data.get("elevations_deg")
        if isinstance(listed, (list, tuple)) and listed and all(_is_elevation(each) for each in listed):
            vertical = {"channels": len(listed), "lower_fov_deg": min(listed), "upper_fov_deg": max(listed)}
            data = {**vertical, **data}
        factors = data.get("points_per_second"), data.get("channels", 128), data.get("rate_hz")
        if "points_per_second" in data and all(isinstance(each, (int, float)) and each > 0 for each in factors):
            points, channels, rate_hz = factors
            data.setdefault("columns", max(1, round(points / (channels * rate_hz))))
        return data

    @model_validator(mode="after")
    def _known_preset(self) -> Self:
        require_known("lidar", self.preset)
        return self

    @model_validator(mode="after")
    def _fields_of_view(self) -> Self:
        if self.lower_fov_deg > self.upper_fov_deg:
            raise ValueError(f"lower_fov_deg {self.lower_fov_deg:g} is above upper_fov_deg {self.upper_fov_deg:g}")
        if self.elevations_deg is not None:
            self._expect("channels", self.channels, len(self.elevations_deg), "the number of elevations_deg")
            self._expect("lower_fov_deg", self.lower_fov_deg, min(self.elevations_deg), "the lowest of elevations_deg")
            self._expect("upper_fov_deg", self.upper_fov_deg, max(self.elevations_deg), "the highest of elevations_deg")
        for name in _BY_CHANNEL:
            if (listed := getattr(self, name)) is not None and len(listed) != self.channels:
                raise ValueError(
                    f"{name} has {len(listed)} numbers; it must have one for each of {self.channels} channels"
                )
        return self

    @model_validator(mode="after")
    def _rosette_alone(self) -> Self:
        if self.rosette is not None:
            repeating = ("horizontal_fov_deg", "elevations_deg", "azimuth_resolution_deg", *_BY_CHANNEL)
            for name in repeating:
                if getattr(self, name) != type(self).model_fields[name].default:
                    raise ValueError(f"{name} has no meaning with rosette; leave it out")
        return self

    @model_validator(mode="after")
    def _points_per_second(self) -> Self:
        if self.points_per_second is None:
            return self
        if self.rate_hz is None:
            raise ValueError("points_per_second needs rate_hz, the turns per second")
        firings_hz = self.channels * self.rate_hz
        if abs(self.points_per_second / firings_hz - self.columns) > 0.5 + 1e-9:
            raise ValueError(
                f"points_per_second {self.points_per_second} is not channels {self.channels} x columns {self.columns} "
                f"x rate_hz {self.rate_hz:g} = {firings_hz * self.columns:.0f}; leave columns or points_per_second out"
            )
        return self

    @model_validator(mode="after")
    def _publishes_something(self) -> Self:
        if self.channels * self.columns > _MAX_RAYS:
            rays = f"channels {self.channels} x columns {self.columns} = {self.channels * self.columns} rays per turn"
            raise ValueError(f"{rays} are too many; allowed are {_MAX_RAYS}")
        if self.min_range_m >= self.range_m:
            raise ValueError(f"min_range_m {self.min_range_m:g} is not below range_m {self.range_m:g}")
        if not (self.points or self.semantic_points):
            raise ValueError("points and semantic_points are both off: the lidar would publish nothing")
        return self

    @staticmethod
    def _expect(name: str, given: float, expected: float, what: str) -> None:
        if abs(given - expected) > _TOLERANCE_DEG:
            raise ValueError(f"{name} {given:g} is not {what}, {expected:g}; leave it out")


def _is_elevation(given: Any) -> bool:
    return isinstance(given, (int, float)) and -90 <= given <= 90


def _preset_for(data: dict[str, Any], preset: dict[str, Any]) -> dict[str, Any]:
    """Properties of a preset that remain valid together with those that the rig gives.

    If the rig changes the channels, they are spread evenly over the preset's vertical field of view. A lidar with
    another rate of rotation keeps its firing rate.
    """
    kept = dict(preset)
    if any(name in data for name in _VERTICAL):
        if listed := preset.get("elevations_deg"):
            kept.update(channels=len(listed), lower_fov_deg=min(listed), upper_fov_deg=max(listed))
        kept = {name: value for name, value in kept.items() if name not in ("elevations_deg", *_BY_CHANNEL)}
    if "elevations_deg" in data:
        kept = {name: value for name, value in kept.items() if name not in _VERTICAL}
    if "points_per_second" in data:
        kept.pop("columns", None)
    rate_hz = data.get("rate_hz")
    if "columns" in kept and isinstance(rate_hz, (int, float)) and rate_hz > 0:
        kept["columns"] = max(1, round(preset["columns"] * preset["rate_hz"] / rate_hz))
    return kept
