"""A fully drawn scene. Given the same SceneSpec the world repeats itself to the byte; it needs no configuration."""

from functools import cached_property

from pydantic import Field

from simbev_ros.config.annotation import Annotation
from simbev_ros.config.base import Model
from simbev_ros.config.rig import Rig
from simbev_ros.config.scenario import EgoDriverKind
from simbev_ros.maps.spec import MapSpec
from simbev_ros.scene.hazards.hazard import HazardSpec
from simbev_ros.scene.lights import LightSpec
from simbev_ros.scene.weather import Weather

NS_PER_S = 1_000_000_000
_HOUR_NS = 3600 * NS_PER_S


class WaypointSpec(Model):
    """A place on a lane."""

    lane: str
    s_m: float = Field(ge=0, description="distance from the lane's start along its centre line")


class StandSpec(Model):
    """Where a vehicle of a hazard area stands for the whole scene: the middle of its footprint, map frame."""

    x_m: float
    y_m: float
    z_m: float = Field(description="about; tells the levels of roads apart")
    yaw_rad: float
    hazard_lights: bool = False
    open_doors: int = Field(0, ge=0, le=255, description="bit k: door k")


class VehicleSpec(Model):
    """One vehicle. The first of a scene is the ego."""

    blueprint: str
    color: int = Field(ge=0, le=0xFFFFFF, description="0xRRGGBB, sRGB")
    start: WaypointSpec
    speed_factor: float = Field(gt=0, description="wanted speed over the speed limit")
    min_gap_m: float = Field(ge=0, description="gap to the front vehicle when stopped")
    reckless: bool = False
    headway_s: float = Field(1.0, gt=0, description="time behind the front vehicle when driving")
    lane_change_eagerness: float = Field(1.0, ge=0, description="to change lanes for speed; 1 is usual")
    distracted: bool = Field(False, description="ignores lights and signs, but not others")
    emergency_lights: bool = False
    door_probability: float = Field(0.0, ge=0, le=1, description="of opening doors at each place where it stands")
    stands_at: StandSpec | None = Field(None, description="it takes no part in traffic; ``start`` is the lane there")


class PedestrianSpec(Model):
    """One pedestrian: starts on a walkable lane and walks to random destinations."""

    blueprint: str
    color: int = Field(ge=0, le=0xFFFFFF, description="0xRRGGBB of the clothes, sRGB")
    start: WaypointSpec
    max_speed_mps: float = Field(gt=0)
    jaywalks: bool = Field(False, description="may cross streets away from crosswalks")
    visits_plazas: bool = Field(False, description="visits the plazas that it passes")


class SceneSpec(Model):
    """All that was drawn for one scene."""

    number: int = Field(ge=0, le=500_000)
    split: str
    seed: int = Field(ge=0)
    map: MapSpec
    tick_ns: int = Field(gt=0)
    warm_up_ticks: int = Field(ge=1)
    ticks: int = Field(ge=1, description="recorded ticks")
    end_after_standing_ticks: int | None = Field(
        None, ge=1, description="the scene ends earlier when the ego has stood still for so long"
    )
    weather: Weather = Field(description="until the first recorded tick")
    final_weather: Weather | None = Field(None, description="at the last tick; none: the weather stays as it is")
    lights: LightSpec = LightSpec()
    ego_driver: EgoDriverKind = "traffic"
    rig: Rig
    annotation: Annotation
    vehicles: tuple[VehicleSpec, ...] = Field(min_length=1)
    pedestrians: tuple[PedestrianSpec, ...]
    walker_cross_factor: float = Field(0.0, ge=0, le=1, description="probability with which each of them may jaywalk")
    hazards: tuple[HazardSpec, ...] = Field((), description="their vehicles are the last ones of ``vehicles``")
    green_time_s: tuple[float, ...] = Field(description="one draw per traffic-light programme, used in turn")

    @property
    def name(self) -> str:
        """``<map>-<number>``, as its folder is called."""
        return f"{self.map.name}-{self.number:04d}"

    @property
    def drivers(self) -> tuple[VehicleSpec, ...]:
        """The vehicles that take part in traffic."""
        return tuple(vehicle for vehicle in self.vehicles if vehicle.stands_at is None)

    @property
    def closed_edges(self) -> frozenset[str]:
        """Streets that nobody drives onto because of hazard areas."""
        return frozenset(edge for hazard in self.hazards for edge in hazard.closed_edges)

    @property
    def start_ns(self) -> int:
        """Stamp of tick 0. An hour of its own for each scene: time never runs backwards from scene to scene.

        Scene 0 has the second hour, because a stamp of 0 means "no time" in ROS.
        """
        return (self.number + 1) * _HOUR_NS + self.warm_up_ticks * self.tick_ns

    def stamp_ns(self, tick: int) -> int:
        """Stamp of a tick; warm-up ticks are negative."""
        return self.start_ns + tick * self.tick_ns

    def weather_at(self, tick: int) -> Weather:
        """Weather of a tick: during the warm-up the initial one, then linearly to the final one at the last tick."""
        if self.final_weather is None or tick <= 0:
            return self.weather
        return self.weather.towards(self.final_weather, min(tick / (self.ticks - 1), 1.0) if self.ticks > 1 else 1.0)

    def tick_of(self, stamp_ns: int) -> int:
        """The tick of a stamp, of one between two ticks the former."""
        return (stamp_ns - self.start_ns) // self.tick_ns

    def publishing_tick_of(self, stamp_ns: int) -> int:
        """The tick at which a message with this stamp is published: of a stamp between two ticks the latter."""
        return -((self.start_ns - stamp_ns) // self.tick_ns)

    def period_ticks(self, rate_hz: float | None) -> int:
        """Every how many ticks something with this rate is due."""
        return 1 if rate_hz is None else max(1, round(NS_PER_S / (rate_hz * self.tick_ns)))

    def messages_per_tick(self, rate_hz: float | None) -> int:
        """How many messages something with this rate has at a tick that it is due at; more than 1 above the ticks'."""
        return 1 if rate_hz is None else max(1, round(rate_hz * self.tick_ns / NS_PER_S))

    @cached_property
    def lead_in_ticks(self) -> int:
        """Warm-up ticks that are published, so that every sensor knows what came before its first sample."""
        periods = [self.period_ticks(sensor.rate_hz) for sensor in self.rig.sensors]
        return min(max(periods, default=1), self.warm_up_ticks)

    @property
    def loaded_tick(self) -> int:
        """The tick before the first published one; finishing it means to have loaded the scene."""
        return -self.lead_in_ticks - 1


def scene_number_of(stamp_ns: int) -> int:
    """Number of the scene that a stamp is of, of its warm-up too; one that is not of any scene has none of theirs."""
    return stamp_ns // _HOUR_NS - 1
