"""What happens along the route of a drive: the section ``drive.events``."""

from typing import Annotated, Any, Literal, get_args

from pydantic import Field, field_validator

from simbev_ros.config.base import Model
from simbev_ros.config.draw import Drawn, within

EventName = Literal[
    "cut_in",
    "hard_brake",
    "hidden_pedestrian",
    "cyclist_at_right_turn",
    "opening_door",
    "red_light_runner",
    "slow_vehicle",
    "blocked_lane",
    "emergency_vehicle",
    "merge",
    "unprotected_left",
    "roundabout",
    "fog_bank",
]


class Events(Model):
    """Events that are drawn along a route, each of a kind for which the route has a place."""

    count: Annotated[Drawn, within(0, 100)] = Field(0.0, description="number of events")
    kinds: dict[EventName, Annotated[float, Field(ge=0, le=1000)]] = Field(
        dict.fromkeys(get_args(EventName), 1.0),
        description="relative frequency of each kind: "
        + ", ".join(get_args(EventName))
        + "; a list: all are as frequent",
    )
    spacing_m: float = Field(40.0, ge=10, le=1000, description="minimum distance along the route between two events")
    required: bool = Field(
        False, description="whether a scene is drawn again, up to 50 times, until its route has room for all events"
    )

    @field_validator("kinds", mode="before")
    @classmethod
    def _list_is_even(cls, kinds: Any) -> Any:
        return dict.fromkeys(kinds, 1.0) if isinstance(kinds, list | tuple) else kinds
