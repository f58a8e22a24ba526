"""A tick as the referee's rules see it: the ego, its movement, the other actors and the place on the road."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
import shapely

from simbev_ros.evaluation.driving.infractions import Infraction, InfractionKind
from simbev_ros.foundation.geometry.footprints import rectangle_corners
from simbev_ros.foundation.geometry.plan_view import left_of
from simbev_ros.foundation.types import BoolArray, Float64Array, Table
from simbev_ros.schema.scene.state import WorldState


@dataclass(eq=False)
class Moment:
    """One tick.

    Attributes:
        state: The state.
        tick_s: Time between two ticks.
        before: The moment of the tick before, and so one more; None at the first one.
        distance_m: Distance along the route that the ego has reached.
    """

    state: WorldState
    tick_s: float
    before: "Moment | None"
    distance_m: float

    @cached_property
    def ego(self) -> Table:
        """The ego's row, shape ()."""
        return self.state.ego

    @cached_property
    def position_m(self) -> Float64Array:
        """(3,) center of the ego's footprint, map frame."""
        return positions_m(self.ego)

    @cached_property
    def speed_mps(self) -> float:
        """Speed of the ego in plan."""
        return float(np.hypot(self.ego["vx"], self.ego["vy"]))

    @cached_property
    def yaw_rad(self) -> float:
        """Heading of the ego."""
        return float(self.ego["yaw"])

    @cached_property
    def ahead(self) -> Float64Array:
        """(2,) unit vector of the ego's heading."""
        return np.array([np.cos(self.yaw_rad), np.sin(self.yaw_rad)])

    @cached_property
    def front_m(self) -> Float64Array:
        """(2,) middle of the ego's front."""
        return self.position_m[:2] + float(self.ego["length"]) / 2.0 * self.ahead

    @cached_property
    def step_m(self) -> Float64Array:
        """(2,) movement of the ego since the tick before."""
        return np.zeros(2) if self.before is None else self.position_m[:2] - self.before.position_m[:2]

    @cached_property
    def corners_m(self) -> Float64Array:
        """(4, 2) corners of the ego's footprint."""
        return rectangle_corners(self.position_m[None], np.array([self.yaw_rad]), sizes_m(self.ego)[None])[0]

    @cached_property
    def footprint(self) -> shapely.Polygon:
        """The ego's footprint in plan."""
        return shapely.Polygon(self.corners_m)

    @cached_property
    def others(self) -> Table:
        """(N,) actors with bodies of their own, ascending by id: neither the ego nor riders."""
        actors = self.state.actors
        return actors[(actors["id"] != self.state.ego_id) & (actors["parent"] == 0)]

    def seen_from_ego(self, rows: Table) -> Float64Array:
        """(N, 2) centers of actors ahead and to the left of the ego's center."""
        offset_m = positions_m(rows)[:, :2] - self.position_m[:2]
        return np.stack([offset_m @ self.ahead, offset_m @ left_of(self.ahead)], axis=1)

    def velocity_before(self, actor_id: int) -> Float64Array:
        """(2,) velocity with which an actor came to the tick before, from its positions; zeros if it was not there.

        Columns of velocities are central differences and contain the impact already.
        """
        last = self.before
        first = last.before if last is not None else None
        if first is None or last is None:
            return np.zeros(2)
        from_m, to_m = _position_of(first, actor_id), _position_of(last, actor_id)
        if from_m is None or to_m is None:
            return np.zeros(2)
        velocity: Float64Array = (to_m - from_m) / ((last.state.tick - first.state.tick) * self.tick_s)
        return velocity

    def infraction(
        self,
        kind: InfractionKind,
        value: float,
        other: str = "",
        *,
        at_fault: bool = True,
        vulnerable: bool = False,
        speed_mps: float | None = None,
    ) -> Infraction:
        """An infraction at this moment."""
        x_m, y_m, z_m = self.position_m.tolist()
        speed = self.speed_mps if speed_mps is None else speed_mps
        state = self.state
        return Infraction(
            kind, state.tick, state.stamp_ns, (x_m, y_m, z_m), speed, other, at_fault, float(value), vulnerable
        )


class Rule(Protocol):
    """A rule of the referee; it keeps what it needs from one moment to the next."""

    def judge(self, moment: Moment) -> Iterator[Infraction]:
        """Yield the infractions that begin at a moment; moments come in order."""


def positions_m(rows: Table) -> Float64Array:
    """(…, 3) positions of actors."""
    return np.stack([rows["x"], rows["y"], rows["z"]], axis=-1)


def sizes_m(rows: Table) -> Float64Array:
    """(…, 3) length, width and height of actors."""
    return np.stack([rows["length"], rows["width"], rows["height"]], axis=-1).astype(np.float64)


def is_beside_in_height(moment: Moment, rows: Table) -> BoolArray:
    """(N,) whether the boxes of actors and of the ego overlap in height."""
    gap_m = rows["z"] - moment.position_m[2]
    overlaps: BoolArray = (gap_m < float(moment.ego["height"])) & (-gap_m < rows["height"])
    return overlaps


def _position_of(moment: Moment, actor_id: int) -> Float64Array | None:
    row = moment.state.actors[moment.state.actors["id"] == actor_id]
    return positions_m(row[0])[:2] if len(row) else None
