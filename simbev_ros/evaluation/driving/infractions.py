"""Infractions: what a vehicle did wrong on its route, as the referee reports it and as JSON records carry it."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any

from pydantic import TypeAdapter, ValidationError


class InfractionKind(StrEnum):
    """Kind of an infraction, with the unit of its ``value``."""

    PEDESTRIAN_COLLISION = "collision_pedestrian"  # relative speed, m/s
    VEHICLE_COLLISION = "collision_vehicle"  # relative speed, m/s
    STATIC_COLLISION = "collision_static"  # relative speed, m/s
    RED_LIGHT = "red_light"  # time for which the light has been red, s
    STOP_SIGN = "stop_sign"  # minimum speed before the line, m/s
    YIELD = "yield_emergency_vehicle"  # time for which the emergency vehicle was held up, s
    MIN_SPEED = "min_speed"  # mean speed divided by that of the traffic nearby
    SCENARIO_TIMEOUT = "scenario_timeout"  # time spent, s
    WRONG_DIRECTION = "wrong_direction"  # distance against the lane within the last second, m
    OFF_ROAD = "off_road"  # distance of the outermost corner from the road, m
    SPEED_LIMIT = "speed_limit"  # excess, m/s
    TIME_TO_COLLISION = "time_to_collision"  # s
    DISCOMFORT = "discomfort"  # largest ratio of a variable of motion to its bound
    STANDSTILL = "standstill"  # these three end the drive: distance along the route, m
    OFF_ROUTE = "off_route"
    TIMEOUT = "timeout"


UNITS: Mapping[InfractionKind, str] = {
    **dict.fromkeys(InfractionKind, "m/s"),
    **dict.fromkeys((InfractionKind.WRONG_DIRECTION, InfractionKind.OFF_ROAD), "m"),
    **dict.fromkeys((InfractionKind.MIN_SPEED, InfractionKind.DISCOMFORT), ""),
    **dict.fromkeys((InfractionKind.RED_LIGHT, InfractionKind.YIELD, InfractionKind.SCENARIO_TIMEOUT), "s"),
    InfractionKind.TIME_TO_COLLISION: "s",
    **dict.fromkeys((InfractionKind.STANDSTILL, InfractionKind.OFF_ROUTE, InfractionKind.TIMEOUT), "m"),
}
"""Units of ``Infraction.value``."""

COLLISIONS = (
    InfractionKind.PEDESTRIAN_COLLISION,
    InfractionKind.VEHICLE_COLLISION,
    InfractionKind.STATIC_COLLISION,
)


@dataclass(frozen=True, slots=True)
class Infraction:
    """An infraction at the tick at which it begins.

    Attributes:
        kind: What was done.
        tick: Tick of the scene.
        stamp_ns: Its simulated time.
        position_m: Position of the vehicle, map frame.
        speed_mps: Speed of the vehicle; for collisions, that before the impact.
        other: The other party: the id of an actor as text, or of a lane, or "" if there is none.
        at_fault: Whether the vehicle is at fault.
        value: How grave it is, see ``InfractionKind``.
        vulnerable: Whether the other party is a pedestrian or rides a bicycle.
    """

    kind: InfractionKind
    tick: int
    stamp_ns: int
    position_m: tuple[float, float, float]
    speed_mps: float
    other: str = ""
    at_fault: bool = True
    value: float = 0.0
    vulnerable: bool = False

    def record(self) -> dict[str, Any]:
        """The infraction as JSON values."""
        return asdict(self)

    @classmethod
    def of_record(cls, record: Mapping[str, Any]) -> "Infraction":
        """The infraction of a record.

        Raises:
            ValueError: The record is not one of an infraction.
        """
        try:
            return _INFRACTIONS.validate_python(dict(record))
        except ValidationError as error:
            raise ValueError(f"no infraction: {error.errors()[0]['msg']}") from None


_INFRACTIONS = TypeAdapter(Infraction)
