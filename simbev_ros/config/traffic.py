"""Vehicles and pedestrians around the ego, and parked vehicles: the section ``traffic``."""

from typing import Annotated, Any, ClassVar

from pydantic import Field

from simbev_ros.config.base import Model
from simbev_ros.config.draw import Distribution, Drawn, PaperOrDrawn, within

_Count = Annotated[PaperOrDrawn, within(0, 10_000)]
_Probability = Annotated[float, Field(ge=0, le=1)]


class Parked(Model):
    """Parked vehicles along curbs, in bays and on drives."""

    density: Annotated[Drawn, within(0, 1)] = Field(
        Distribution(beta=(2.0, 1.0)),
        description="share of the usual number, which depends on the street and on day or night; 0: none",
    )


class Traffic(Model):
    """Vehicles and pedestrians around the ego."""

    NOBODY: ClassVar[dict[str, Any]] = {"vehicles": 0, "pedestrians": 0, "parked": {"density": 0}, "resting_share": 0}

    vehicles: _Count = Field("paper", description="number of vehicles besides the ego")
    pedestrians: _Count = Field("paper", description="number of pedestrians")
    parked: Parked = Parked()
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
    ignore_lights_probability: _Probability = Field(
        0.0, description="probability that any driver, also that of an agent, ignores traffic lights in the whole scene"
    )
    ignore_signs_probability: _Probability = Field(0.0, description="the same for stop signs")
    ignore_vehicles_probability: _Probability = Field(
        0.0, description="the same for vehicles, except for those ahead on the same lane"
    )
    ignore_pedestrians_probability: _Probability = Field(0.0, description="the same for pedestrians")
    emergency_lights_probability: float = Field(
        0.5, ge=0, le=1, description="probability that an emergency vehicle has its lights on"
    )
    yield_to_emergency: bool | None = Field(
        None,
        description="traffic makes way for vehicles with emergency lights, which pass red lights; none: in a drive",
    )
    wrecks_cleared_s: float | None = Field(
        None,
        ge=10,
        le=3000,
        description="time after which wrecks, but for those of agents, are removed; none: never, in a drive after 30 s",
    )
    door_probability: float = Field(0.1, ge=0, le=1, description="probability that a stationary vehicle opens doors")
    pedestrian_max_speed_mps: Annotated[Drawn, within(0.8, 12)] = Field(
        Distribution(lognormal=(0.16, 0.64), min=0.8, max=8),
        description="maximum speed; pedestrians faster than about 2.1 m/s run",
    )
    wheelchair_probability: _Probability | None = Field(
        None, description="probability that a pedestrian uses a wheelchair; none: 4 %, as the catalog says"
    )
    walker_cross_factor: Annotated[Drawn, within(0, 1)] = Field(
        Distribution(beta=(2.4, 1.6)), description="share of pedestrians that may jaywalk, drawn for each scene"
    )
    pedestrian_standing_share: _Probability = Field(
        0.1, description="mean share of the time in which a pedestrian stands on its sidewalk, 5 to 25 s each time"
    )
    group_probability: _Probability = Field(
        0.2,
        description="probability that a walking pedestrian joins the one before it, in groups of up to three, which"
        " neither jaywalk nor visit plazas",
    )
    plaza_probability: float = Field(
        0.5, ge=0, le=1, description="probability that a walking pedestrian visits plazas on the way; runners do not"
    )
    resting_share: _Probability = Field(
        0.2, description="further people, per pedestrian, who sit or stand at benches, bus shelters, shops all the time"
    )
    green_time_s: Annotated[Drawn, within(2, 300)] = Field(
        Distribution(uniform=(4, 28)),
        description="duration of a green phase of a traffic-light program; on map files, of its longest one",
    )
