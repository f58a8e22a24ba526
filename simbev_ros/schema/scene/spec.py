"""The specification of one fully drawn scene.

Scene drawing produces a ``SceneSpec`` from a configuration and a map. The world simulation needs nothing but this
specification and the map, and replays it byte for byte.
"""

from collections.abc import Set
from typing import Literal, Self, get_args

from pydantic import Field, model_validator

from simbev_ros.config.base import Model
from simbev_ros.config.scenario import Split
from simbev_ros.foundation.files.limits import (
    MAX_ACTORS,
    MAX_AGENTS,
    MAX_SCENE_NUMBER,
    MAX_SCENE_TICKS,
    MAX_WARM_UP_TICKS,
)
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.schema.scene.agent_spec import AgentSpec
from simbev_ros.schema.scene.appearance import AppearanceSpec
from simbev_ros.schema.scene.drive_spec import DriveSpec
from simbev_ros.schema.scene.hazard import HazardSpec
from simbev_ros.schema.scene.lights import LightSpec
from simbev_ros.schema.scene.map_spec import MapSpec
from simbev_ros.schema.scene.storyboard_spec import StoryboardSpec
from simbev_ros.schema.scene.v2x_spec import V2xSpec
from simbev_ros.schema.scene.weather import Weather
from simbev_ros.schema.stored import Stored

YELLOW_S, ALL_RED_S = 3.0, 2.0
"""Durations of the two phases between greens, the same at all traffic lights."""

Ignored = Literal["lights", "signs", "vehicles", "pedestrians"]
"""What drivers ignore: traffic lights, stop signs, vehicles but for those ahead on the same lane, pedestrians."""

MAX_GROUP_SIZE = 3
"""Maximum number of pedestrians that walk side by side."""

_HOUR_NS = 3600 * NS_PER_S
_MAX_SEED = (1 << 63) - 1


class WaypointSpec(Model):
    """A position on a lane."""

    lane: str
    s_m: float = Field(ge=0, description="distance from the lane's start along its center line")


class StandSpec(Model):
    """Pose of a vehicle that stands in a hazard area for the whole scene: its footprint's center, map frame."""

    x_m: float
    y_m: float
    z_m: float = Field(description="approximate height; identifies the road level")
    yaw_rad: float
    hazard_lights: bool = False
    open_doors: int = Field(0, ge=0, le=255, description="bit k: door k")


class VehicleSpec(Model):
    """One vehicle. The first vehicle of a scene is the ego's."""

    blueprint: str
    color: int = Field(ge=0, le=0xFFFFFF, description="0xRRGGBB, sRGB")
    start: WaypointSpec
    speed_factor: float = Field(gt=0, description="desired speed divided by the speed limit")
    min_gap_m: float = Field(ge=0, description="gap to the vehicle in front when stopped")
    reckless: bool = False
    headway_s: float = Field(1.0, gt=0, description="time gap to the vehicle in front when driving")
    lane_change_eagerness: float = Field(
        1.0, ge=0, description="eagerness to change lanes for speed; 1 is SUMO's default"
    )
    distracted: bool = Field(False, description="ignores lights and signs, but not other road users")
    ignores: tuple[Ignored, ...] = Field(
        (), exclude_if=lambda value: not value, description="what the driver ignores in addition"
    )
    via: tuple[str, ...] = Field(
        (), exclude_if=lambda value: not value, description="edges that the route passes, before it goes on at random"
    )
    emergency_lights: bool = False
    door_probability: float = Field(0.0, ge=0, le=1, description="probability of opening doors at each stop")
    stands_at: StandSpec | None = Field(
        None, description="set: the vehicle takes no part in traffic and ``start`` is the lane on which it stands"
    )

    @property
    def ignored(self) -> Set[Ignored]:
        """All that the driver ignores."""
        of_kind: tuple[Ignored, ...] = get_args(Ignored)[: 4 if self.reckless else 2 if self.distracted else 0]
        return {*of_kind, *self.ignores}


class PedestrianSpec(Model):
    """One pedestrian, who starts on a walkable lane and walks to random destinations."""

    blueprint: str
    color: int = Field(ge=0, le=0xFFFFFF, description="0xRRGGBB of the clothes, sRGB")
    start: WaypointSpec
    max_speed_mps: float = Field(gt=0)
    jaywalks: bool = Field(False, description="may cross streets away from crosswalks")
    visits_plazas: bool = Field(False, description="visits the plazas on its route")
    companion_of: int | None = Field(
        None, ge=0, exclude_if=lambda value: value is None, description="index of the pedestrian that it walks beside"
    )


class DatumSpec(Model):
    """Position of the map's origin on Earth, WGS 84, and the direction of its x axis."""

    latitude_deg: float = Field(ge=-90, le=90)
    longitude_deg: float = Field(ge=-180, le=360)
    altitude_m: float = Field(ge=-20_000, le=20_000, description="altitude of height 0 of the map")
    map_from_east_rad: float = Field(ge=-7, le=7, description="direction of map x, counterclockwise from east")


class SceneSpec(Stored):
    """Everything that was drawn for one scene.

    ``schema.scene.agents.agent_views`` gives the scene as each of its agents sees it.
    """

    number: int = Field(ge=0, le=MAX_SCENE_NUMBER)
    split: Split
    seed: int = Field(ge=0, le=_MAX_SEED)
    map: MapSpec
    tick_ns: int = Field(gt=0, le=NS_PER_S)
    warm_up_ticks: int = Field(ge=1, le=MAX_WARM_UP_TICKS)
    ticks: int = Field(ge=1, le=MAX_SCENE_TICKS, description="number of recorded ticks")
    end_after_standing_ticks: int | None = Field(
        None,
        ge=1,
        le=MAX_SCENE_TICKS,
        description="the scene ends early once the ego has stood still for this number of ticks",
    )
    weather: Weather = Field(description="until the first recorded tick")
    final_weather: Weather | None = Field(None, description="at the last tick; none: the weather does not change")
    lights: LightSpec = LightSpec()
    appearance: AppearanceSpec = AppearanceSpec()
    agents: tuple[AgentSpec, ...] = Field(
        min_length=1, max_length=MAX_AGENTS, description="the first one is the ego, which drives the first vehicle"
    )
    v2x: V2xSpec | None = Field(None, description="messages between agents; none: they send none")
    vehicles: tuple[VehicleSpec, ...] = Field(min_length=1, max_length=MAX_ACTORS)
    pedestrians: tuple[PedestrianSpec, ...] = Field(max_length=MAX_ACTORS)
    walker_cross_factor: float = Field(0.0, ge=0, le=1, description="probability that a pedestrian may jaywalk")
    pedestrian_standing_share: float = Field(
        0.0, ge=0, le=1, description="mean share of the time in which a pedestrian stands on its sidewalk"
    )
    parked_density: float = Field(
        0.0,
        ge=0,
        le=1,
        exclude_if=lambda value: not value,
        description="share of the usual number of parked vehicles; the world draws them for the map's spots",
    )
    resting_share: float = Field(
        0.0, ge=0, le=1, exclude_if=lambda value: not value, description="people who rest, per pedestrian nearby"
    )
    yields_to_emergency: bool = Field(
        False, exclude_if=lambda value: not value, description="traffic makes way for vehicles with blue lights"
    )
    wrecks_cleared_s: float | None = Field(
        None,
        ge=10,
        exclude_if=lambda value: value is None,
        description="time from a collision to the removal of wrecks",
    )
    hazards: tuple[HazardSpec, ...] = Field((), description="their vehicles are the last entries of ``vehicles``")
    drive: DriveSpec | None = Field(
        None, exclude_if=lambda value: value is None, description="the first agent's route; none: it has none"
    )
    storyboard: StoryboardSpec | None = Field(
        None, exclude_if=lambda value: value is None, description="the scenario that moves entities; none: traffic does"
    )
    datum: DatumSpec | None = Field(None, description="the map's position on Earth; none: an earlier version drew it")
    green_time_s: tuple[float, ...] = Field(description="one draw per traffic-light program, used in turn")

    @model_validator(mode="after")
    def _agents_are_distinct(self) -> Self:
        names = [agent.name for agent in self.agents]
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(f"agents: two agents are called {', '.join(twice)}; names must be unique")
        if self.agents[0].vehicle != 0:
            raise ValueError(f"agents: {names[0]}, the ego, must have vehicle 0")
        carriers = [agent.vehicle for agent in self.agents if agent.vehicle is not None]
        if max(carriers) >= len(self.vehicles):
            raise ValueError(f"agents: there is no vehicle {max(carriers)}; the scene has {len(self.vehicles)}")
        if len(set(carriers)) < len(carriers):
            raise ValueError("agents: two agents have the same vehicle")
        if self.v2x is not None and (unknown := sorted({*self.v2x.agents} - {*names})):
            raise ValueError(f"v2x.agents: there is no agent {unknown[0]}; the scene has {', '.join(names)}")
        return self

    def leader_of(self, pedestrian: int) -> int:
        """Index of the pedestrian whose route and pauses a pedestrian shares: that of its group, or its own."""
        leader = self.pedestrians[pedestrian].companion_of
        return pedestrian if leader is None else leader

    @model_validator(mode="after")
    def _companions_follow_their_leader(self) -> Self:
        for index, pedestrian in enumerate(self.pedestrians):
            leader = pedestrian.companion_of
            if leader is not None and not index - MAX_GROUP_SIZE < leader < index:
                raise ValueError(f"pedestrians.{index}.companion_of: is {leader}, not one of the two before it")
        return self

    @model_validator(mode="after")
    def _events_have_actors(self) -> Self:
        for index, event in enumerate(self.drive.events if self.drive is not None else ()):
            for name in ("vehicles", "pedestrians"):
                if any(not 0 <= actor < len(getattr(self, name)) for actor in getattr(event, name)):
                    raise ValueError(f"drive.events.{index}.{name}: the scene has {len(getattr(self, name))} {name}")
        return self

    @property
    def is_driven_by_traffic(self) -> bool:
        """Whether no agent is driven from outside, so that the specification determines the scene."""
        return all(agent.driver == "traffic" for agent in self.agents)

    @property
    def name(self) -> str:
        """Scene name ``<map>-<number>``, which is also the name of its folder."""
        return f"{self.map.name}-{self.number:04d}"

    @property
    def drivers(self) -> tuple[VehicleSpec, ...]:
        """Vehicles that take part in traffic."""
        return tuple(vehicle for vehicle in self.vehicles if vehicle.stands_at is None)

    def entity_blueprints(self, kind: str) -> list[str]:
        """Blueprints of a kind, such as ``vehicle``, of the scenario's entities besides the first agent."""
        cast = () if self.storyboard is None else self.storyboard.cast[1:]
        return [each.blueprint for each in cast if each.blueprint.startswith(f"{kind}.")]

    def count_of(self, kind: Literal["vehicle", "pedestrian"]) -> int:
        """Number of vehicles or pedestrians, with those of the scenario."""
        return len(getattr(self, f"{kind}s")) + len(self.entity_blueprints(kind))

    @property
    def closed_edges(self) -> frozenset[str]:
        """Ids of the edges that hazard areas close to all traffic."""
        return frozenset(edge for hazard in self.hazards for edge in hazard.closed_edges)

    @property
    def start_ns(self) -> int:
        """Timestamp of tick 0. Every scene has an hour of its own, so time never runs backwards between scenes.

        Scene 0 gets the second hour, because a stamp of 0 means "no time" in ROS.
        """
        return (self.number + 1) * _HOUR_NS + self.warm_up_ticks * self.tick_ns

    def stamp_ns(self, tick: int) -> int:
        """Timestamp of a tick; warm-up ticks are negative."""
        return self.start_ns + tick * self.tick_ns

    def weather_at(self, tick: int) -> Weather:
        """Weather at a tick: constant in the warm-up, then changing linearly to the final one at the last tick."""
        if self.final_weather is None or tick <= 0:
            return self.weather
        return self.weather.interpolate(
            self.final_weather, min(tick / (self.ticks - 1), 1.0) if self.ticks > 1 else 1.0
        )

    def tick_of(self, stamp_ns: int) -> int:
        """Tick of a timestamp; a timestamp between two ticks belongs to the earlier one."""
        return (stamp_ns - self.start_ns) // self.tick_ns

    def publishing_tick_of(self, stamp_ns: int) -> int:
        """Tick at which a message with this timestamp is published: between two ticks, the later one."""
        return -((self.start_ns - stamp_ns) // self.tick_ns)

    def period_ticks(self, rate_hz: float | None) -> int:
        """Number of ticks between two samples of something with this rate; None means every tick."""
        return 1 if rate_hz is None else max(1, round(NS_PER_S / (rate_hz * self.tick_ns)))

    def messages_per_tick(self, rate_hz: float | None) -> int:
        """Number of messages at a due tick of something with this rate; more than 1 above the tick rate."""
        return 1 if rate_hz is None else max(1, round(rate_hz * self.tick_ns / NS_PER_S))

    @property
    def lead_in_ticks(self) -> int:
        """Number of published warm-up ticks: each sensor of any agent gets the history that its first sample needs."""
        sensors = (sensor for agent in self.agents for sensor in agent.rig.sensors)
        rates_hz = [sensor.rate_hz for sensor in sensors if sensor.rate_hz is not None]
        return min(self.period_ticks(min(rates_hz, default=None)), self.warm_up_ticks)

    @property
    def loaded_tick(self) -> int:
        """The tick before the first published one; a node that reports it as finished has loaded the scene."""
        return -self.lead_in_ticks - 1


def scene_number_of(stamp_ns: int) -> int:
    """Number of the scene that a timestamp, of its warm-up too, belongs to; no scene's number if there is none."""
    return stamp_ns // _HOUR_NS - 1
