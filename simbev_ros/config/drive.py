"""The section ``drive``: the first agent drives a route, and the scene ends when it is done, stuck or lost."""

from collections.abc import Collection
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Discriminator, Field, Tag, field_validator

from simbev_ros.config.agents import Ego
from simbev_ros.config.base import FieldError, Keys, Model
from simbev_ros.config.draw import Drawn, within
from simbev_ros.config.drive_events import Events
from simbev_ros.config.evaluation import split_command
from simbev_ros.config.included_stacks import DRIVER_INTERFACE, INCLUDED_DRIVERS
from simbev_ros.config.places import SpawnPose

MAX_ROUTE_M = 20_000.0


class LanePoint(Model):
    """A position on a driving lane."""

    lane: str = Field(min_length=1, description="SUMO's id of the lane")
    s_m: float = Field(0.0, ge=0, description="distance from the lane's start along its center line")


def _point_form(value: Any) -> str:
    """Tag of a point's form in a file."""
    is_on_lane = isinstance(value, LanePoint) or (isinstance(value, dict) and "lane" in value)
    return "lane" if is_on_lane else "pose"


RoutePoint = Annotated[
    Annotated[LanePoint, Tag("lane")] | Annotated[SpawnPose, Tag("pose")],
    Discriminator(_point_form),
]
"""A position on a lane, by its id or by a pose, which is moved to the nearest lane."""

RoutePoints = Annotated[tuple[RoutePoint, ...], Field(min_length=2)]


def _form(value: Any) -> str:
    """Tag of a route's form in a file."""
    return "drawn" if isinstance(value, str) else "by_map" if isinstance(value, dict) else "points"


class Drive(Model):
    """A route that the first agent drives, and the rules by which the drive ends before `time.duration_s`."""

    route: Annotated[
        Annotated[Literal["drawn"], Tag("drawn")]
        | Annotated[RoutePoints, Tag("points")]
        | Annotated[dict[str, RoutePoints], Tag("by_map")],
        Discriminator(_form),
    ] = Field(
        "drawn",
        description="drawn: a random route from the start of the first agent, through the places of `ego.route` if "
        "there are any; or at least two points, each `{lane, s_m}` or `{x_m, y_m}`, joined by shortest paths, of which "
        "the first is the start and the last the goal; or `{from, to}` with two points; or such lists by the names of "
        "maps",
    )
    goal_m: Annotated[Drawn, within(20, MAX_ROUTE_M)] = Field(
        300.0, description="length of a drawn route; `[min, max]` is short for a uniform distribution"
    )
    goal_radius_m: float = Field(5.0, gt=0, le=100, description="remaining distance at which the goal is reached")
    standstill_s: float = Field(60.0, gt=0, le=3000, description="standstill of the vehicle that ends the drive")
    off_route_m: float = Field(30.0, gt=0, le=1000, description="distance from the route that ends the drive")
    timeout_s: float | None = Field(
        None, gt=0, le=3000, description="time from tick 0 that ends the drive; none: `time.duration_s` alone"
    )
    events: Events | None = Field(None, description="what happens along the route; none: nothing that is not traffic")

    stack: Annotated[tuple[str, ...] | None, BeforeValidator(split_command)] = Field(
        None,
        description="command that starts the driver with the graph, or the name of an included one, with `ego.driver: "
        f"{DRIVER_INTERFACE}`: {', '.join(f'`{name}`' for name in INCLUDED_DRIVERS)}; none: traffic or a node outside "
        "drives. A driver that dies or falls silent ends no scene: the vehicle brakes, and the drive is scored",
    )

    @field_validator("route", mode="before")
    @classmethod
    def _ends_are_points(cls, route: Any) -> Any:
        return (route["from"], route["to"]) if isinstance(route, dict) and {*route} == {"from", "to"} else route

    @field_validator("goal_m", mode="before")
    @classmethod
    def _bounds_are_uniform(cls, goal_m: Any) -> Any:
        return {"uniform": list(goal_m)} if isinstance(goal_m, list | tuple) else goal_m

    @property
    def included_driver(self) -> str | None:
        """Name of the driver, if it is one of those that come with the package."""
        return self.stack[0] if self.stack and self.stack[0] in INCLUDED_DRIVERS else None

    def points_on(self, map_name: str) -> tuple[Keys, tuple[LanePoint | SpawnPose, ...]]:
        """The keys of the field with the points on a map, and these points; none: the route is drawn."""
        if isinstance(self.route, dict):
            return ("route", map_name), self.route.get(map_name, ())
        return ("route",), () if self.route == "drawn" else self.route

    def require_fitting(self, ego: Ego, maps: Collection[str]) -> None:
        """Check the section against the first agent and the names of the configuration's maps.

        Raises:
            FieldError: The driver does not drive the agent, both the route and the agent say where it drives, or the
                route has no points on a map.
        """
        wanted = DRIVER_INTERFACE if self.included_driver else "ackermann, trajectory or path"
        if self.stack and ego.driver not in wanted.replace(" or", ",").split(", "):
            raise FieldError(["drive", "stack"], f"drives nothing, as ego.driver is {ego.driver}; it must be {wanted}")
        if self.route == "drawn":
            return
        if ego.spawn or ego.route:
            name = "spawn" if ego.spawn else "route"
            raise FieldError(
                ["drive", "route"], f"ego.{name} is set, too; a route of points says where the vehicle drives"
            )
        if isinstance(self.route, dict) and {*self.route} != {*maps}:
            found = ", ".join(self.route)
            raise FieldError(
                ["drive", "route"], f"must have points on each map with scenes, {', '.join(maps)}; found {found}"
            )
