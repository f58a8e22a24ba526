"""The configuration file as a pydantic model, ``Scenario``, with a model for each section; defaults as in the paper."""

from collections.abc import Sequence
from fnmatch import fnmatchcase
from functools import cached_property
from typing import Annotated, Any, Literal, Self, TypeVar

import yaml
from pydantic import Field, field_validator, model_validator

from simbev_ros.config.acceptance import Acceptance
from simbev_ros.config.agents import (
    Agent,
    Ego,
    driver_participant,
    require_consistent_agents,
    require_consistent_evaluations,
    require_heights_of_vehicle,
    require_maps_of_poses,
)
from simbev_ros.config.annotation import Annotation
from simbev_ros.config.appearance import Appearance
from simbev_ros.config.base import FieldError, Keys, Model, dotted_path
from simbev_ros.config.draw import Distribution, Drawn, within
from simbev_ros.config.drive import Drive
from simbev_ros.config.evaluation import EvaluatedAgent, Evaluation, ParticipantName
from simbev_ros.config.frames import DEFAULT_FRAMES, Frames
from simbev_ros.config.hazards import Hazards
from simbev_ros.config.included_stacks import INCLUDED_DRIVERS, INCLUDED_STACKS
from simbev_ros.config.lights import Lights
from simbev_ros.config.map_files import Bounds, map_name
from simbev_ros.config.rates import MAX_UNEVEN_HZ, require_fitting_rate, require_fitting_rates
from simbev_ros.config.rendering import Rendering
from simbev_ros.config.rig import Rig, S
from simbev_ros.config.traffic import Traffic
from simbev_ros.config.v2x import V2x
from simbev_ros.config.weather import WeatherConfig
from simbev_ros.foundation.units import NS_PER_S

DepthForm = Literal["png", "rvl"]
"""Compression of depth images."""
Split = Literal["train", "val", "test"]
SPLITS: tuple[Split, ...] = ("train", "val", "test")

A = TypeVar("A", bound=Ego)

_MIN_DURATION_S = 0.001
_TICK_TOLERANCE = 2.5e-3


class MapScenes(Model):
    """Number of scenes to generate on a map, for each split."""

    map: str = Field(
        "",
        description="name of a town, or map file relative to the configuration's folder; empty: the one that "
        "`scenario` names",
    )
    scenario: str = Field(
        "",
        exclude_if=lambda value: not value,
        description="OpenSCENARIO file (.xosc) that these scenes play, relative to the configuration's folder; "
        "empty: traffic alone",
    )
    bounds: Bounds | None = Field(
        None,
        description="part of an OpenStreetMap file: west, south, east, north in degrees; none: all, or the densest "
        "part of a file that is too large",
    )
    train: int = Field(0, ge=0, le=100_000, description="number of scenes in the training split")
    val: int = Field(0, ge=0, le=100_000, description="number of scenes in the validation split")
    test: int = Field(0, ge=0, le=100_000, description="number of scenes in the test split")

    @model_validator(mode="after")
    def _has_roads(self) -> Self:
        if not self.map and not self.scenario:
            raise FieldError(["map"], "is missing")
        return self


class Timing(Model):
    """Tick length and durations of a scene."""

    tick_s: float = Field(
        0.05,
        ge=0.001,
        le=1,
        description="length of a simulation step: whole milliseconds, or 1/n s for n up to 60 (0.0333 is 1/30)",
    )
    warm_up_s: float = Field(10.0, gt=0, le=600, description="simulated time before recording starts")
    duration_s: Annotated[Drawn, within(_MIN_DURATION_S, 3000)] = Field(
        16.0, description="recorded time; a random value is rounded to whole ticks"
    )
    end_after_standing_s: float | None = Field(
        None, gt=0, le=3000, description="standstill of the ego after which the scene ends; none: never ends early"
    )

    @field_validator("tick_s")
    @classmethod
    def _countable_tick(cls, tick_s: float) -> float:
        rate_hz, tick_ms = round(1 / tick_s), 1000 * tick_s
        if abs(tick_ms - round(tick_ms)) < 1e-6:
            return tick_s
        if abs(rate_hz * tick_s - 1) < _TICK_TOLERANCE and rate_hz <= MAX_UNEVEN_HZ:
            return 1 / rate_hz
        raise ValueError(f"{tick_s:g} is neither whole milliseconds nor 1/n s for n up to {MAX_UNEVEN_HZ}")

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
    chunk_kib: int = Field(4096, ge=64, le=65_536, description="size of chunks, which are compressed as a whole")
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
    max_real_time_factor: float | None = Field(
        None,
        ge=0.01,
        le=100,
        description="in lockstep, simulated time per wall time is at most this; none: as fast as possible",
    )
    silence_timeout_s: float = Field(
        60.0,
        ge=1,
        le=3600,
        description="time without a sign of life from a node that ends the scene; computing while loading is one",
    )

    def real_time_factor(self, *, live: bool) -> float:
        """Simulated time per wall time at which a graph is meant to run; 0: as fast as it can."""
        return 1.0 if live else self.max_real_time_factor or 0.0


class Scenario(Model):
    """The whole configuration file."""

    seed: int = Field(0, ge=0, le=2**31, description="base seed; a scene's seed is its number plus this value")
    scenes: tuple[MapScenes, ...] = Field(min_length=1)
    scenarios: tuple[str, ...] = Field(
        (),
        exclude=True,
        description="OpenSCENARIO files (.xosc), each an entry of `scenes` with one scene of the split test; without "
        "`traffic` and `hazards`, nobody is there but their entities",
    )
    time: Timing = Timing()
    rig: Rig
    frames: Frames = DEFAULT_FRAMES
    ego: Ego = Ego()
    agents: tuple[Agent, ...] = Field(
        (),
        description="agents after the first one, which `rig`, `frames`, `ego` and `annotation` describe; in a file "
        "without `rig`, all agents",
    )
    v2x: V2x | None = Field(
        None,
        description="messages that agents send each other, with `{}` as by default; none: they send none",
    )
    weather: WeatherConfig = WeatherConfig()
    lights: Lights = Lights()
    appearance: Appearance = Appearance()
    traffic: Traffic = Traffic()
    hazards: Hazards = Hazards()
    drive: Drive | None = Field(
        None,
        exclude_if=lambda value: value is None,
        description="a route that the first agent drives, with `{}` as by default; none: it drives at random",
    )
    accept: Acceptance | None = Field(
        None, description="rules that a scene must meet, else it is drawn again; none: every scene is accepted"
    )
    annotation: Annotation = Annotation()
    rendering: Rendering = Rendering()
    recording: Recording = Recording()
    graph: GraphConfig = GraphConfig()
    evaluation: Evaluation | None = Field(
        None, description="live evaluation of a perception stack; none: no evaluation"
    )

    @model_validator(mode="before")
    @classmethod
    def _with_scenes_of_scenarios(cls, data: Any) -> Any:
        if not isinstance(data, dict) or not isinstance(files := data.get("scenarios"), list):
            return data
        scenes = [*data.get("scenes", ()), *({"scenario": file, "test": 1} for file in files)]
        return {"traffic": Traffic.NOBODY, "hazards": {"count": 0}} | data | {"scenes": scenes, "scenarios": []}

    @property
    def rigs(self) -> tuple[Rig, ...]:
        """Rigs of all agents that a scene can have, the first agent's first; each has the name of its agent."""
        others = (
            agent.rig.model_copy(update={"agent": name})
            for agent in self.agents
            for name in agent.names(agent.max_count)
        )
        return (self.rig, *others)

    def sensors_of_type(self, kind: type[S]) -> list[S]:
        """Sensors of one type of all agents that a scene can have, in order."""
        return [sensor for rig in self.rigs for sensor in rig.of_type(kind)]

    @property
    def v2x_agents(self) -> tuple[str, ...]:
        """Names of all agents that a scene can have and that take part in V2X; without the section there are none."""
        if self.v2x is None:
            return ()
        others = [name for agent in self.agents if agent.v2x for name in agent.names(agent.max_count)]
        return (*([self.rig.agent] if self.ego.v2x else []), *others)

    @property
    def is_driven_by_traffic(self) -> bool:
        """Whether no agent is driven from outside."""
        return all(agent.driver == "traffic" for agent in (self.ego, *self.agents))

    def for_replay(self) -> Self:
        """A copy in which no vehicle waits for stamped commands, as all of them move as they were recorded."""

        def undriven(agent: A) -> A:
            return agent.model_copy(update={"driver": "traffic"}) if agent.is_commanded else agent

        return self.model_copy(update={"ego": undriven(self.ego), "agents": tuple(map(undriven, self.agents))})

    @property
    def participants(self) -> tuple[str, ...]:
        """Outside nodes on /sync/ready for which the world waits, including evaluated stacks and drivers."""
        stacks = (name for agent in self.evaluated_agents for name in agent.participants)
        commanded = [self.rig.agent] if self.ego.is_commanded else []
        commanded += [name for each in self.agents if each.is_commanded for name in each.names(each.max_count)]
        driving = map(driver_participant, commanded)
        boxes = self.driver_boxes
        seeing = () if boxes is None else (INCLUDED_STACKS[boxes].participant,)
        return tuple(dict.fromkeys((*self.graph.participants, *stacks, *seeing, *driving)))

    @property
    def driver_boxes(self) -> str | None:
        """Included stack that runs because the driver needs its boxes; none if it is evaluated, and runs anyway."""
        driver = None if self.drive is None else self.drive.included_driver
        boxes = None if driver is None else INCLUDED_DRIVERS[driver]
        return None if self.evaluation is not None and self.evaluation.included is not None else boxes

    @property
    def evaluated_agents(self) -> tuple[EvaluatedAgent, ...]:
        """The agents whose stacks are evaluated, the first agent first."""
        sections = [("", self.rig, self.evaluation), *((each.name, each.rig, each.evaluation) for each in self.agents)]
        return tuple(EvaluatedAgent(name, rig, section) for name, rig, section in sections if section is not None)

    def as_yaml(self) -> str:
        """The whole configuration as YAML, as it is stored in bags."""
        return str(yaml.safe_dump(self.model_dump(mode="json"), sort_keys=False))

    @cached_property
    def origins(self) -> dict[Keys, tuple[str, Keys]]:
        """For the fields of scenes and agents, file with line and the field's name there; filled by ``config.load``.

        It is not part of the configuration: it is neither compared nor dumped, but copied and pickled.
        """
        return {}

    def where(self, *keys: str | int) -> str:
        """Words for a field of scenes or agents: ``my.yaml:14: agents[1].near``; without a file, its name alone."""
        for depth in range(len(keys), 0, -1):
            if keys[:depth] in self.origins:
                line, file_keys = self.origins[keys[:depth]]
                return f"{line}: {dotted_path((*file_keys, *keys[depth:]))}"
        return dotted_path(keys)

    @model_validator(mode="after")
    def _agents_are_consistent(self) -> Self:
        require_heights_of_vehicle(self.rig)
        if self.agents:
            require_consistent_agents(self.rig, self.agents)
        require_consistent_evaluations(self.evaluation, self.agents)
        maps = {map_name(entry.map, entry.bounds): None for entry in self.scenes if entry.map}
        require_maps_of_poses(self.ego, self.agents, maps)
        if self.drive is not None:
            self.drive.require_fitting(self.ego, maps)
        return self

    @model_validator(mode="after")
    def _rates_fit_tick_rate(self) -> Self:
        require_fitting_rates((), self.rig, self.annotation, 1 / self.time.tick_s)
        for index, agent in enumerate(self.agents):
            require_fitting_rates(("agents", index), agent.rig, agent.annotation, 1 / self.time.tick_s)
        return self

    @model_validator(mode="after")
    def _agents_can_exchange_messages(self) -> Self:
        if self.v2x is not None:
            rate = ("v2x", "rate_hz"), self.v2x.rate_hz
            require_fitting_rate(*rate, 1 / self.time.tick_s)
            for agent, labels in ((self.ego, None), *((each, each.annotation) for each in self.agents)):
                labels_hz = (labels or self.annotation).rate_hz
                if agent.v2x and labels_hz is not None:  # messages contain boxes
                    require_fitting_rate(*rate, labels_hz, "annotation.rate_hz")
            if len(self.v2x_agents) < 2:
                raise FieldError(["v2x"], f"needs at least 2 agents that take part; found {len(self.v2x_agents)}")
        return self

    @model_validator(mode="after")
    def _motion_is_known_ahead(self) -> Self:
        if self.accept is not None and not self.is_driven_by_traffic:
            raise ValueError("accept: needs agents that traffic drives (driver: traffic)")
        return self

    @model_validator(mode="after")
    def _at_least_one_scene(self) -> Self:
        if not any(entry.train + entry.val + entry.test for entry in self.scenes):
            raise ValueError("scenes: all counts are 0; ask for at least one scene")
        return self
