"""Towed units: trailers, caravans and the rear sections of buses follow the hitches of the vehicles that tow them.

The world knows one leading point for a vehicle with its trailer. The hitch hangs on the vehicle's body, and the axle of
the towed unit follows the hitch on a tractrix.
"""

from dataclasses import dataclass, field

import numpy as np

from simbev_ros.foundation.geometry.plan_view import left_of
from simbev_ros.foundation.types import Float64Array, Int64Array

_MAX_ARTICULATION_RAD = 1.2
_MIN_STEP_M = 1e-9


@dataclass(frozen=True, slots=True)
class Towing:
    """How T units hang behind other bodies.

    Attributes:
        leader: (T,) int64 index of the vehicle that tows each unit.
        behind_m: (T,) distance from the vehicle's leading point back to the hitch.
        length_m: (T,) distance from the hitch back to the unit's axle, or the middle of several.
    """

    leader: Int64Array = field(default_factory=lambda: np.zeros(0, np.int64))
    behind_m: Float64Array = field(default_factory=lambda: np.zeros(0))
    length_m: Float64Array = field(default_factory=lambda: np.zeros(0))


def towed_headings(heading: Float64Array, step_m: Float64Array, length_m: Float64Array) -> Float64Array:
    """Headings of towed units after their hitches have moved straight, in closed form.

    The axle rolls without slip toward the hitch, so the angle φ from step to heading obeys L dφ/ds = -sin φ (the
    tractrix; kinematics of trailers: J.-P. Laumond, ed., Robot Motion Planning and Control, Springer 1998, chapter 1).
    Its solution is tan(φ/2) = tan(φ₀/2) exp(-s/L).

    Args:
        heading: (..., 2) unit vectors before the step.
        step_m: (..., 2) steps of the hitches in plan; backward ones push the unit.
        length_m: (...) distances from the hitches to the axles.
    """
    distance_m = np.linalg.norm(step_m, axis=-1)
    along = step_m / np.maximum(distance_m, _MIN_STEP_M)[..., None]
    left = left_of(along)
    cosine = np.sum((heading + along) ** 2, axis=-1) / 2.0  # 1 + cos φ
    sine = np.sum(heading * left, axis=-1) * np.exp(-distance_m / length_m)
    square = cosine**2 + sine**2  # 0: pushed exactly straight back
    turned = ((cosine**2 - sine**2)[..., None] * along + (2.0 * cosine * sine)[..., None] * left) / np.maximum(
        square, 1e-30
    )[..., None]
    moved = (distance_m > _MIN_STEP_M) & (square > 1e-24)
    return np.where(moved[..., None], turned, heading)


class TowedUnits:
    """The towed units of a scene, which start straight behind their vehicles.

    Attributes:
        hitch_m: (T, 3) hitches, map frame.
        forward: (T, 3) unit vectors of the headings, with the slope of the vehicles that tow.
    """

    def __init__(self, towing: Towing, point_m: Float64Array, forward: Float64Array) -> None:
        """Start behind (G, 3) leading points of bodies with (G, 3) unit vectors of their headings."""
        self._towing = towing
        self.hitch_m, self.forward = self._hitches_m(point_m, forward), forward[towing.leader]

    def follow(self, point_m: Float64Array, forward: Float64Array) -> None:
        """Follow the bodies to their next (G, 3) leading points and (G, 3) headings."""
        before_m, ahead = self.hitch_m, forward[self._towing.leader]
        self.hitch_m = self._hitches_m(point_m, forward)
        step_m = (self.hitch_m - before_m)[:, :2]
        heading = towed_headings(_plan(self.forward), step_m, self._towing.length_m)
        heading = _limit_articulation(heading, _plan(ahead))
        self.forward = np.column_stack([heading * np.sqrt(1.0 - ahead[:, 2:] ** 2), ahead[:, 2]])

    def _hitches_m(self, point_m: Float64Array, forward: Float64Array) -> Float64Array:
        leader = self._towing.leader
        hitch_m: Float64Array = point_m[leader] - self._towing.behind_m[:, None] * forward[leader]
        return hitch_m


def _plan(forward: Float64Array) -> Float64Array:
    """(T, 2) unit vectors in plan."""
    return forward[:, :2] / np.linalg.norm(forward[:, :2], axis=1, keepdims=True)


def _limit_articulation(heading: Float64Array, ahead: Float64Array) -> Float64Array:
    """(T, 2) headings, turned no farther from (T, 2) those of the vehicles than the joint allows."""
    left = left_of(ahead)
    angle_rad = np.arctan2(np.sum(heading * left, axis=1), np.sum(heading * ahead, axis=1))
    limit_rad = np.clip(angle_rad, -_MAX_ARTICULATION_RAD, _MAX_ARTICULATION_RAD)[:, None]
    return np.where(
        np.abs(angle_rad)[:, None] > _MAX_ARTICULATION_RAD,
        np.cos(limit_rad) * ahead + np.sin(limit_rad) * left,
        heading,
    )
