"""The configuration file as a pydantic model, ``Scenario``, with a model for each section; defaults as in the paper."""

from collections.abc import Sequence
from fnmatch import fnmatchcase
from typing import Annotated, Literal, Self

import yaml
from pydantic import Field, model_validator

from simbev_ros.config.annotation import Annotation
from simbev_ros.config.base import Model
from simbev_ros.config.draw import Distribution, Drawn, PaperOrDrawn, within
from simbev_ros.config.evaluation import Evaluation, ParticipantName
from simbev_ros.config.frames import DEFAULT_FRAMES, Frames, are_default
from simbev_ros.config.hazards import Hazards
from simbev_ros.config.lights import Lights
from simbev_ros.config.map_files import Bounds
from simbev_ros.config.positioning import Imu
from simbev_ros.config.rendering import Rendering
from simbev_ros.config.rig import Rig
from simbev_ros.units import NS_PER_S

DepthForm = Literal["png", "rvl"]
"""Compression of depth images."""
Split = Literal["train", "val", "test"]
SPLITS: tuple[Split, ...] = ("train", "val", "test")

_Percent = Annotated[PaperOrDrawn, within(0, 100)]
_Count = Annotated[PaperOrDrawn, within(0, 10_000)]
_MIN_DURATION_S = 0.001
_Probability = Annotated[float, Field(ge=0, le=1)]


class MapScenes(Model):
    """Number of scenes to generate on a map, for each split."""

    map: str = Field(min_length=1, description="name of a town, or map file relative to the configuration's folder")
    bounds: Bounds | None = Field(
        None,
        description="part of an OpenStreetMap file: west, south, east, north in degrees; none: all, or the densest "
        "part of a file that is too large",
    )
    train: int = Field(0, ge=0, le=100_000, description="number of scenes in the training split")
    val: int = Field(0, ge=0, le=100_000, description="number of scenes in the validation split")
    test: int = Field(0, ge=0, le=100_000, description="number of scenes in the test split")


class Timing(Model):
    """Tick length and durations of a scene."""

    tick_s: float = Field(0.05, ge=0.001, le=1, description="length of a simulation step")
    warm_up_s: float = Field(4.0, gt=0, le=600, description="simulated time before recording starts")
    duration_s: Annotated[Drawn, within(_MIN_DURATION_S, 3000)] = Field(
        16.0, description="recorded time; a drawn value is rounded to whole ticks"
    )
    end_after_standing_s: float | None = Field(
        None, gt=0, le=3000, description="standstill of the ego after which the scene ends; none: never ends early"
    )

    @model_validator(mode="after")
    def _whole_ticks(self) -> Self:
        for name in ("warm_up_s", "duration_s"):
            seconds = getattr(self, name)
            if isinstance(seconds, Distribution):
                continue
            ticks = seconds / self.tick_s
            if abs(ticks - round(ticks)) > 1e-6 or round(ticks) < 1:
                raise ValueError(f"{name} {seconds:g} is not a whole number of ticks of {self.tick_s:g} s")
        return self

    @property
    def tick_ns(self) -> int:
        """Length of a tick, ns."""
        return round(self.tick_s * NS_PER_S)


def _is_whole(ratio: float) -> bool:
    return round(ratio) >= 1 and abs(ratio - round(ratio)) < 1e-6


def _dividing_rates(tick_hz: float) -> str:
    """Text that lists the rates which divide the tick rate."""
    return f"{tick_hz:g}, {tick_hz / 2:g}, {tick_hz / 3:g}, …"


class WeatherParameters(Model):
    """Weather and light; ``paper`` draws by the rules of the paper's table, some of which depend on other values."""

    cloudiness: _Percent = Field("paper", description="cloud cover in percent")
    precipitation: _Percent = Field("paper", description="rain intensity in percent")
    precipitation_deposits: _Percent = Field("paper", description="area covered by puddles in percent")
    wetness: _Percent = Field("paper", description="wetness of roads in percent")
    wind_intensity: _Percent = Field("paper", description="wind intensity in percent")
    sun_azimuth_deg: Annotated[PaperOrDrawn, within(0, 360)] = Field(
        "paper", description="azimuth of the sun, counterclockwise from the map's x axis"
    )
    sun_altitude_deg: Annotated[PaperOrDrawn, within(-90, 90)] = Field(
        "paper", description="altitude of the sun above the horizon; negative at night"
    )
    fog_density: _Percent = Field("paper", description="fog density in percent")
    fog_distance_m: Annotated[PaperOrDrawn, within(0)] = Field("paper", description="distance at which fog starts")
    fog_falloff: Annotated[PaperOrDrawn, within(0)] = Field(
        "paper", description="decrease of fog with height; 0: none, above 5: close to the ground"
    )


class WeatherConfig(WeatherParameters):
    """Weather and light at the scene's start and, if they change, at its end."""

    final: WeatherParameters | None = Field(
        None, description="weather at the last tick, reached linearly from the first; parameters not given are `paper`"
    )


EgoDriverKind = Literal["traffic", "twist"]


class SpawnPose(Model):
    """Start pose of the ego: the center of its footprint, map frame; it is moved to the nearest lane."""

    x_m: float = Field(ge=-1e6, le=1e6, description="x in the map frame")
    y_m: float = Field(ge=-1e6, le=1e6, description="y in the map frame")
    z_m: float | None = Field(
        None, ge=-1e4, le=1e4, description="height of the road, which selects one of several levels"
    )
    yaw_deg: float | None = Field(
        None, ge=-360, le=360, description="approximate heading, which selects the driving direction"
    )


class Ego(Model):
    """The ego vehicle."""

    blueprint: str = Field("vehicle.sedan", description="name of a vehicle in the catalog")
    driver: EgoDriverKind = Field(
        "traffic",
        description="traffic: the ego drives like other vehicles; "
        "twist: it follows geometry_msgs/Twist on /<agent>/cmd_vel, linear.x in m/s and angular.z in rad/s",
    )
    spawn: tuple[SpawnPose, ...] = Field(
        (), description="start poses, of which one is drawn for each scene; none: anywhere on the map"
    )
    reckless_probability: _Probability = Field(
        0.01, description="probability that the ego ignores lights, signs and other road users"
    )


class Traffic(Model):
    """Vehicles and pedestrians around the ego."""

    vehicles: _Count = Field("paper", description="number of vehicles besides the ego")
    pedestrians: _Count = Field("paper", description="number of pedestrians")
    spawn_radius_m: float = Field(
        400.0, gt=0, le=10_000, description="maximum distance from the ego at which actors start"
    )
    waypoint_spacing_m: float = Field(24.0, ge=12, le=500, description="distance between start positions of vehicles")
    speed_factor: Annotated[Drawn, within(0.1, 4)] = Field(
        Distribution(uniform=(0.8, 1.4)), description="desired speed as a multiple of the speed limit"
    )
    min_gap_m: Annotated[Drawn, within(0.2, 20)] = Field(
        Distribution(normal=(3.2, 1.0), min=0.5, max=10), description="gap to the vehicle ahead at a standstill"
    )
    headway_s: Annotated[Drawn, within(0.3, 10)] = Field(
        Distribution(normal=(1.2, 0.25), min=0.7, max=2.5), description="time gap to the vehicle ahead while driving"
    )
    lane_change_eagerness: Annotated[Drawn, within(0, 20)] = Field(
        Distribution(lognormal=(0.0, 0.6), min=0.1, max=5),
        description="eagerness to change lanes for speed; 1 is usual",
    )
    reckless_probability: _Probability = Field(
        0.01, description="probability that a driver ignores lights, signs and other road users"
    )
    distracted_probability: float = Field(
        0.02, ge=0, le=1, description="probability that a driver ignores lights and signs, but not other road users"
    )
    emergency_lights_probability: float = Field(
        0.5, ge=0, le=1, description="probability that an emergency vehicle has its lights on"
    )
    door_probability: float = Field(0.1, ge=0, le=1, description="probability that a stationary vehicle opens doors")
    pedestrian_max_speed_mps: Annotated[Drawn, within(0.8, 12)] = Field(
        Distribution(lognormal=(0.16, 0.64), min=0.8, max=8),
        description="maximum speed; pedestrians faster than about 2.1 m/s run",
    )
    walker_cross_factor: Annotated[Drawn, within(0, 1)] = Field(
        Distribution(beta=(2.4, 1.6)), description="share of pedestrians that may jaywalk, drawn for each scene"
    )
    plaza_probability: float = Field(
        0.5, ge=0, le=1, description="probability that a walking pedestrian visits plazas on the way; runners do not"
    )
    green_time_s: Annotated[Drawn, within(2, 300)] = Field(
        Distribution(uniform=(4, 28)),
        description="duration of a green phase of a traffic-light program; on map files, of its longest one",
    )


class RecordedTopics(Model):
    """Topics that are recorded, by patterns: ``*`` matches anything, slashes included, ``?`` any single character."""

    include: tuple[str, ...] = Field(("*",), min_length=1, description="patterns of which a recorded topic matches one")
    exclude: tuple[str, ...] = Field((), description="patterns of which a recorded topic matches none")

    @model_validator(mode="after")
    def _can_match(self) -> Self:
        for pattern in (*self.include, *self.exclude):
            if not pattern.startswith(("/", "*", "?", "[")):
                raise ValueError(f"{pattern!r} matches no topic: names of topics begin with a slash")
        return self

    def __contains__(self, name: object) -> bool:
        def is_matched(patterns: Sequence[str]) -> bool:
            return any(fnmatchcase(str(name), pattern) for pattern in patterns)

        return is_matched(self.include) and not is_matched(self.exclude)


class Recording(Model):
    """Recording of scenes: topics, compression, file sizes and disk space."""

    topics: RecordedTopics = RecordedTopics()
    forms: tuple[Literal["tables", "messages"], ...] = Field(
        ("tables",),
        description="forms of the world and its labels; messages: in addition to the tables and the JSON, which this "
        "package itself reads, messages of simbev_interfaces on topics that end in /typed",
    )
    images: Literal["compressed", "raw"] = Field(
        "compressed", description="format of recorded images; compressed: JPEG and PNG"
    )
    jpeg_quality: int = Field(90, ge=1, le=100, description="JPEG quality of color images, also on live topics")
    depth: DepthForm = Field(
        "png",
        description="compression of depth images, also on live topics; rvl: the one that Rerun reads, takes longer",
    )
    chunk_kib: int = Field(4096, ge=64, le=65_536, description="size of chunks, whose messages are compressed together")
    zstd_level: int | None = Field(1, ge=1, le=19, description="compression level of chunks; none: not compressed")
    split_mib: int | None = Field(
        None, ge=1, description="file size at which the bag continues in a new file; none: a single file"
    )
    sync_mib: int = Field(32, ge=1, le=4096, description="amount of messages that is synced to disk together")
    min_free_mib: int = Field(512, ge=0, description="free disk space below which recording ends")

    @model_validator(mode="after")
    def _has_tables(self) -> Self:
        if "tables" not in self.forms or len(set(self.forms)) < len(self.forms):
            raise ValueError("forms: allowed are [tables] and [tables, messages]")
        return self


class GraphConfig(Model):
    """The ROS graph: lockstep between nodes, outside participants and timeouts."""

    window_ticks: Literal["auto"] | Annotated[int, Field(ge=1, le=8)] = Field(
        "auto",
        description="maximum lead of the world over the slowest node; auto: 3, or 8 on 8 or more CPU cores if no node "
        "outside takes part and none drives the ego",
    )
    participants: tuple[ParticipantName, ...] = Field(
        (), description="outside nodes on /sync/ready for which the world waits"
    )
    live_reliability: Literal["best_effort", "reliable"] = Field(
        "best_effort",
        description="reliability of sensor topics in real time; reliable: for subscribers with ROS's default QoS, too",
    )
    silence_timeout_s: float = Field(
        60.0,
        ge=1,
        le=3600,
        description="time without a sign of life from a node that ends the scene; computing while loading is one",
    )


class Scenario(Model):
    """The whole configuration file."""

    seed: int = Field(0, ge=0, le=2**31, description="base seed; a scene's seed is its number plus this value")
    scenes: tuple[MapScenes, ...] = Field(min_length=1)
    time: Timing = Timing()
    rig: Rig
    frames: Frames = Field(DEFAULT_FRAMES, exclude_if=are_default)
    ego: Ego = Ego()
    weather: WeatherConfig = WeatherConfig()
    lights: Lights = Lights()
    traffic: Traffic = Traffic()
    hazards: Hazards = Hazards()
    annotation: Annotation = Annotation()
    rendering: Rendering = Rendering()
    recording: Recording = Recording()
    graph: GraphConfig = GraphConfig()
    evaluation: Evaluation | None = Field(
        None, description="live evaluation of a perception stack; none: no evaluation"
    )

    @property
    def participants(self) -> tuple[str, ...]:
        """Outside nodes on /sync/ready for which the world waits, including the evaluated stack."""
        stack = () if self.evaluation is None else self.evaluation.participants
        return tuple(dict.fromkeys((*self.graph.participants, *stack)))

    def as_yaml(self) -> str:
        """The whole configuration as YAML, as it is stored in bags."""
        return str(yaml.safe_dump(self.model_dump(mode="json"), sort_keys=False))

    @model_validator(mode="after")
    def _rates_fit_tick_rate(self) -> Self:
        tick_hz = 1 / self.time.tick_s
        for sensor in self.rig.sensors:
            rate_hz = sensor.rate_hz
            if rate_hz is None or _is_whole(tick_hz / rate_hz):
                continue
            allowed = _dividing_rates(tick_hz)
            if not isinstance(sensor, Imu):
                raise ValueError(
                    f"rig: sensor {sensor.name}: rate_hz {rate_hz:g} does not divide the tick rate {tick_hz:g} Hz; "
                    f"allowed are {allowed} (only an imu can be faster than the ticks)"
                )
            if not _is_whole(rate_hz / tick_hz):
                raise ValueError(
                    f"rig: sensor {sensor.name}: rate_hz {rate_hz:g} neither divides the tick rate {tick_hz:g} Hz nor "
                    f"is a multiple of it; allowed are {allowed} and {2 * tick_hz:g}, {3 * tick_hz:g}, …"
                )
        return self

    @model_validator(mode="after")
    def _label_rates_divide_tick_rate(self) -> Self:
        tick_hz = 1 / self.time.tick_s
        for name in ("occupancy", "vector_map"):
            rate_hz = getattr(getattr(self.annotation, name), "rate_hz", None)
            if rate_hz is not None and not _is_whole(tick_hz / rate_hz):
                raise ValueError(
                    f"annotation.{name}: rate_hz {rate_hz:g} does not divide the tick rate {tick_hz:g} Hz; allowed are "
                    f"{_dividing_rates(tick_hz)}"
                )
        return self

    @model_validator(mode="after")
    def _at_least_one_scene(self) -> Self:
        if not any(entry.train + entry.val + entry.test for entry in self.scenes):
            raise ValueError("scenes: all counts are 0; ask for at least one scene")
        return self
