"""The specification of one fully drawn scene.

Scene drawing produces a ``SceneSpec`` from a configuration and a map. The world simulation needs nothing but this
specification and the map, and replays it byte for byte.
"""

from functools import cached_property

from pydantic import Field

from simbev_ros.config.annotation import Annotation
from simbev_ros.config.base import Model
from simbev_ros.config.frames import DEFAULT_FRAMES, Frames, are_default
from simbev_ros.config.rig import Rig
from simbev_ros.config.scenario import EgoDriverKind, Split
from simbev_ros.limits import MAX_ACTORS, MAX_SCENE_NUMBER, MAX_SCENE_TICKS, MAX_WARM_UP_TICKS
from simbev_ros.maps.spec import MapSpec
from simbev_ros.scene.hazards.hazard import HazardSpec
from simbev_ros.scene.lights import LightSpec
from simbev_ros.scene.weather import Weather
from simbev_ros.units import NS_PER_S

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
    """One vehicle. The first vehicle of a scene is the ego."""

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
    emergency_lights: bool = False
    door_probability: float = Field(0.0, ge=0, le=1, description="probability of opening doors at each stop")
    stands_at: StandSpec | None = Field(
        None, description="set: the vehicle takes no part in traffic and ``start`` is the lane on which it stands"
    )


class PedestrianSpec(Model):
    """One pedestrian, who starts on a walkable lane and walks to random destinations."""

    blueprint: str
    color: int = Field(ge=0, le=0xFFFFFF, description="0xRRGGBB of the clothes, sRGB")
    start: WaypointSpec
    max_speed_mps: float = Field(gt=0)
    jaywalks: bool = Field(False, description="may cross streets away from crosswalks")
    visits_plazas: bool = Field(False, description="visits the plazas on its route")


class SceneSpec(Model):
    """Everything that was drawn for one scene."""

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
    ego_driver: EgoDriverKind = "traffic"
    rig: Rig
    frames: Frames = Field(DEFAULT_FRAMES, exclude_if=are_default)
    base_link_x_m: float = Field(
        0.0,
        ge=-20,
        le=20,
        exclude_if=lambda x_m: x_m == 0.0,
        description="x of the origin of base_link in the ego frame; readers need no catalog of vehicles for it",
    )
    annotation: Annotation
    vehicles: tuple[VehicleSpec, ...] = Field(min_length=1, max_length=MAX_ACTORS)
    pedestrians: tuple[PedestrianSpec, ...] = Field(max_length=MAX_ACTORS)
    walker_cross_factor: float = Field(0.0, ge=0, le=1, description="probability that a pedestrian may jaywalk")
    hazards: tuple[HazardSpec, ...] = Field((), description="their vehicles are the last entries of ``vehicles``")
    green_time_s: tuple[float, ...] = Field(description="one draw per traffic-light program, used in turn")

    @property
    def name(self) -> str:
        """Scene name ``<map>-<number>``, which is also the name of its folder."""
        return f"{self.map.name}-{self.number:04d}"

    @property
    def drivers(self) -> tuple[VehicleSpec, ...]:
        """Vehicles that take part in traffic."""
        return tuple(vehicle for vehicle in self.vehicles if vehicle.stands_at is None)

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

    @cached_property
    def lead_in_ticks(self) -> int:
        """Number of published warm-up ticks: each sensor gets the history that its first sample needs."""
        periods = [self.period_ticks(sensor.rate_hz) for sensor in self.rig.sensors]
        return min(max(periods, default=1), self.warm_up_ticks)

    @property
    def loaded_tick(self) -> int:
        """The tick before the first published one; a node that reports it as finished has loaded the scene."""
        return -self.lead_in_ticks - 1


def scene_number_of(stamp_ns: int) -> int:
    """Number of the scene that a timestamp, of its warm-up too, belongs to; no scene's number if there is none."""
    return stamp_ns // _HOUR_NS - 1
