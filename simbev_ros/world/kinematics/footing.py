"""How bodies stand on the ground: with their wheels or feet on the planes that fit the surface below."""

from dataclasses import dataclass

import numpy as np

from simbev_ros.types import Float64Array, Int64Array
from simbev_ros.world.kinematics.ground import Ground


@dataclass(frozen=True, slots=True)
class Contacts:
    """C points at which G bodies touch the ground, at least one each, ascending by body.

    Attributes:
        body: (C,) int64.
        ahead_m: (C,) of the body's origin; those of one body sum up to zero.
        left_m: (C,) the same to the left.
    """

    body: Int64Array
    ahead_m: Float64Array
    left_m: Float64Array


class Footing:
    """Fits planes to the ground below bodies."""

    def __init__(self, ground: Ground, contacts: Contacts) -> None:
        self._ground = ground
        self._contacts = contacts
        self._count = np.bincount(contacts.body)
        self._ahead_per_m, self._left_per_m = (
            arm_m / np.maximum(self._sums(arm_m**2), 1e-9)[contacts.body]
            for arm_m in (contacts.ahead_m, contacts.left_m)
        )

    def planes(self, origin_m: Float64Array, forward: Float64Array) -> Float64Array:
        """The planes of least squares through the ground at each body's contacts.

        Args:
            origin_m: (G, 3) map frame; heights need only be near enough to tell the level.
            forward: (G, 3) unit vectors in which the bodies look.

        Returns:
            (G, 3) height at the origin, and rise per metre ahead and to the left.
        """
        contacts = self._contacts
        ahead = forward[contacts.body]
        heading = ahead[:, :2] / np.linalg.norm(ahead[:, :2], axis=1, keepdims=True)
        point_m = origin_m[contacts.body] + contacts.ahead_m[:, None] * ahead
        point_m[:, :2] += contacts.left_m[:, None] * np.column_stack([-heading[:, 1], heading[:, 0]])
        height_m = self._ground.heights_m(point_m)
        flat = np.linalg.norm(forward[:, :2], axis=1)  # the wheelbase in plan is so much shorter
        rise_ahead = self._sums(self._ahead_per_m * height_m) / flat
        rise_left = self._sums(self._left_per_m * height_m)
        return np.stack([self._sums(height_m) / self._count, rise_ahead, rise_left], axis=1)

    def _sums(self, values: Float64Array) -> Float64Array:
        """(G,) sums of (C,) values over each body's contacts."""
        return np.bincount(self._contacts.body, values).astype(np.float64)
