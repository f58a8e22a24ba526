"""How bodies stand on the ground: least-squares planes through the surface below their wheels or feet."""

from dataclasses import dataclass

import numpy as np

from simbev_ros.foundation.geometry.plan_view import left_of
from simbev_ros.foundation.types import Float64Array, Int64Array
from simbev_ros.simulation.world.kinematics.ground import GroundSurface


@dataclass(frozen=True, slots=True)
class ContactPoints:
    """C points at which G bodies touch the ground, at least one each, ascending by body.

    Attributes:
        body: (C,) int64, index of the body.
        ahead_m: (C,) distance ahead of the body's origin; sums up to zero for each body.
        left_m: (C,) distance to the left of the body's origin; sums up to zero for each body.
    """

    body: Int64Array
    ahead_m: Float64Array
    left_m: Float64Array


class GroundPlanes:
    """Fits planes to the ground below bodies."""

    def __init__(self, ground: GroundSurface, contacts: ContactPoints) -> None:
        self._ground = ground
        self._contacts = contacts
        self._count = np.bincount(contacts.body)
        self._ahead_per_m, self._left_per_m = (
            arm_m / np.maximum(self._sums(arm_m**2), 1e-9)[contacts.body]
            for arm_m in (contacts.ahead_m, contacts.left_m)
        )

    def fit_planes(self, origin_m: Float64Array, forward: Float64Array) -> Float64Array:
        """Fit a least-squares plane through the ground at each body's contact points.

        Args:
            origin_m: (G, 3) map frame; heights need only be accurate enough to identify the level.
            forward: (G, 3) unit vectors of the headings.

        Returns:
            (G, 3) height at the origin, and rise per meter ahead and to the left.
        """
        contacts = self._contacts
        forward_at_contact = forward[contacts.body]
        heading = forward_at_contact[:, :2] / np.linalg.norm(forward_at_contact[:, :2], axis=1, keepdims=True)
        point_m = origin_m[contacts.body] + contacts.ahead_m[:, None] * forward_at_contact
        point_m[:, :2] += contacts.left_m[:, None] * left_of(heading)
        height_m = self._ground.heights_m(point_m)
        plan_length = np.linalg.norm(forward[:, :2], axis=1)  # factor by which the wheelbase is shorter in plan
        rise_ahead = self._sums(self._ahead_per_m * height_m) / plan_length
        rise_left = self._sums(self._left_per_m * height_m)
        return np.stack([self._sums(height_m) / self._count, rise_ahead, rise_left], axis=1)

    def _sums(self, values: Float64Array) -> Float64Array:
        """(G,) sums of (C,) values over each body's contact points."""
        return np.bincount(self._contacts.body, values).astype(np.float64)
