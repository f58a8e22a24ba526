"""What the motions of all events share: the ego on its route, the world that they act on, and their interface."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from simbev_ros.foundation.types import Float64Array
from simbev_ros.scene.weather_course import WeatherCourse
from simbev_ros.schema.scene.drive_spec import EventSpec
from simbev_ros.simulation.world.actors import Actors
from simbev_ros.simulation.world.sumo.traffic import SumoTraffic

_REASON = "event"
_PATIENCE_S, _NEAR_M = 3.0, 60.0  # an ego that has stood for so long, so near, has arrived


class EgoOnRoute(NamedTuple):
    """The ego at SUMO's moment: distance of its front along its route, speed, and time for which it has stood."""

    front_m: float
    speed_mps: float
    stood_s: float

    def arrival_s(self, at_m: float) -> float:
        """Time until its front is at a distance along the route, at its present speed; 0 if it waits close before."""
        ahead_m = at_m - self.front_m
        if self.stood_s > _PATIENCE_S and ahead_m < _NEAR_M:
            return 0.0
        return max(ahead_m, 0.0) / max(self.speed_mps, 1.0)


@dataclass(frozen=True, slots=True)
class Stage:
    """What the motion of an event acts on.

    Attributes:
        event: The event.
        sumo: SUMO's traffic.
        actors: Pedestrians and doors.
        weather: Weather at each tick.
        next_tick: Function that returns the next tick to be published.
        tick_s: Length of a tick.
        vehicles: Rows of the event's vehicles among those of the scene.
        pedestrians: Rows of its pedestrians.
    """

    event: EventSpec
    sumo: SumoTraffic
    actors: Actors
    weather: WeatherCourse
    next_tick: Callable[[], int]
    tick_s: float
    vehicles: Sequence[int]
    pedestrians: Sequence[int]

    def __getitem__(self, name: str) -> float:
        """A parameter of the event."""
        return self.event.parameters[name]


class EventMotion:
    """The motion of one event, whose vehicle may be held or have its speed given while it is not like all others."""

    is_held = False
    """Whether the vehicle stands until the event begins."""

    def __init__(self, stage: Stage) -> None:
        """Prepare the actors, before the first tick."""
        self._stage, self._vehicle = stage, next(iter(stage.vehicles), -1)
        if self.is_held:
            self._limit_speed(0.0)

    def begins(self, ego: EgoOnRoute, along_m: Float64Array) -> bool:
        """Act at a tick before the event; returns whether it begins now, unless that is earlier than its trigger.

        Args:
            ego: The ego.
            along_m: (K,) distances along the route of the fronts of the event's vehicles.
        """
        return True

    def advance(self, ego: EgoOnRoute, along_m: Float64Array) -> bool:
        """Act at a tick of the event; returns whether it is over; the arguments are those of ``begins``."""
        raise NotImplementedError

    def _limit_speed(self, speed_mps: float | None) -> None:
        """Limit the speed of the vehicle; None lifts the limit."""
        self._stage.sumo.limit_speed(self._vehicle, _REASON, speed_mps)

    def _accelerate(self, to_mps: float, mps2: float, heeds_leaders: bool = False) -> float:
        """Give the vehicle its speed for one tick, on the way to another one; returns the new speed."""
        speed_mps, step_mps = self._stage.sumo.speed_mps(self._vehicle), mps2 * self._stage.tick_s
        new_mps = min(max(to_mps, speed_mps - step_mps), speed_mps + step_mps)
        self._stage.sumo.given.set_speed(self._vehicle, new_mps, heeds_leaders)
        return new_mps

    def _release(self) -> bool:
        """Let the vehicle's driver drive again; the event is over."""
        self._limit_speed(None)
        self._stage.sumo.given.set_speed(self._vehicle, None)
        return True


def travel_s(distance_m: float, speed_mps: float, mps2: float) -> float:
    """Time from rest over a distance, with an acceleration up to a speed."""
    starting_m = speed_mps**2 / (2.0 * mps2)
    if distance_m < starting_m:
        return float(np.sqrt(2.0 * distance_m / mps2))
    return speed_mps / mps2 + (distance_m - starting_m) / speed_mps
