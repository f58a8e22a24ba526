"""Specification of a drive: the route of the first agent, the rules by which it ends, and the events along it."""

from collections.abc import Mapping
from enum import StrEnum
from functools import cached_property
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from simbev_ros.config.base import Model
from simbev_ros.foundation.files.limits import MAX_DRIVE_EVENTS, MAX_ROUTE_POINTS
from simbev_ros.foundation.types import Float64Array

Column = Annotated[tuple[float, ...], Field(min_length=2, max_length=MAX_ROUTE_POINTS)]


class Command(StrEnum):
    """Maneuver at a point of a route. ``follow`` has no choice; the three of junctions hold from entry to exit."""

    FOLLOW = "follow"
    LEFT = "left"
    RIGHT = "right"
    STRAIGHT = "straight"
    CHANGE_LEFT = "change_left"
    CHANGE_RIGHT = "change_right"


class RouteSpec(Model):
    """A route: points along lane centers, up to 1 m apart, with one entry for each point in every column.

    Between two lanes of an edge, the points of a lane change lead smoothly from one center line to the other.
    """

    x_m: Column = Field(description="map frame")
    y_m: Column = Field(description="map frame")
    z_m: Column = Field(description="height of the lane, map frame")
    distance_m: Column = Field(description="distance from the first point along the route in plan view, increasing")
    limit_mps: Column = Field(description="speed limit of the lane")
    lane: tuple[str, ...] = Field(max_length=MAX_ROUTE_POINTS, description="id of the lane, junctions included")
    command: tuple[Command, ...] = Field(max_length=MAX_ROUTE_POINTS)

    @model_validator(mode="after")
    def _columns_fit(self) -> Self:
        count = len(self.x_m)
        if short := [name for name in type(self).model_fields if len(getattr(self, name)) != count]:
            raise ValueError(f"route.{short[0]}: must have {count} entries, one for each point")
        if self.distance_m[0] != 0.0 or np.any(np.diff(self.distance_m) <= 0.0):
            raise ValueError("route.distance_m: must begin with 0 and increase")
        return self

    @cached_property
    def points_m(self) -> Float64Array:
        """(N, 3) points, map frame."""
        return np.column_stack([self.x_m, self.y_m, self.z_m])

    @cached_property
    def yaw_rad(self) -> Float64Array:
        """(N,) directions of the route at its points, each toward the next one."""
        step_m = np.diff(self.points_m[:, :2], axis=0)
        yaw_rad = np.arctan2(step_m[:, 1], step_m[:, 0])
        return np.append(yaw_rad, yaw_rad[-1])

    @property
    def length_m(self) -> float:
        """Distance from the first point to the goal, which is the last one."""
        return self.distance_m[-1]


class EventKind(StrEnum):
    """Class of what happens on a route."""

    CUT_IN = "cut_in"
    HARD_BRAKE = "hard_brake"
    HIDDEN_PEDESTRIAN = "hidden_pedestrian"
    CYCLIST_AT_RIGHT_TURN = "cyclist_at_right_turn"
    OPENING_DOOR = "opening_door"
    RED_LIGHT_RUNNER = "red_light_runner"
    SLOW_VEHICLE = "slow_vehicle"
    BLOCKED_LANE = "blocked_lane"
    EMERGENCY_VEHICLE = "emergency_vehicle"
    MERGE = "merge"
    UNPROTECTED_LEFT = "unprotected_left"
    ROUNDABOUT = "roundabout"
    FOG_BANK = "fog_bank"


class EventSpec(Model):
    """An event, which begins when the first agent has driven so far along its route."""

    kind: EventKind
    trigger_m: float = Field(ge=0, description="distance along the route at which it begins")
    vehicles: tuple[int, ...] = Field((), description="indices of its vehicles in the scene's ``vehicles``")
    pedestrians: tuple[int, ...] = Field((), description="indices of its pedestrians in ``pedestrians``")
    parameters: Mapping[str, float] = Field({}, description="what was drawn for it, with units in the names")


class DriveSpec(Model):
    """What the first agent drives, and what ends the drive before the last tick of the scene."""

    route: RouteSpec
    goal_radius_m: float = Field(gt=0, description="remaining distance along the route at which the goal is reached")
    standstill_s: float = Field(gt=0, description="standstill that ends the drive")
    off_route_m: float = Field(gt=0, description="distance from the route that ends the drive")
    timeout_s: float | None = Field(None, gt=0, description="time from tick 0 that ends the drive; none: no limit")
    events: tuple[EventSpec, ...] = Field((), max_length=MAX_DRIVE_EVENTS, description="in the order of the route")
