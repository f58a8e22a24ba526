"""Velocities of points on actors: the rigid motion of the body, and the motion of wheels and limbs relative to it."""

import numpy as np

from simbev_ros.assets.actors.skeletons import Skeletons
from simbev_ros.foundation.geometry.transforms import inverse
from simbev_ros.foundation.types import Float64Array, Int32Array, Table
from simbev_ros.scene.interpolation import interpolate_actors
from simbev_ros.schema.scene.state import map_from_actors

_STEP = 0.01
"""Fraction of a tick over which poses are differentiated; wheels turn by a few hundredths of a radian meanwhile."""


def body_velocities(actors: Table, points_m: Float64Array) -> Float64Array:
    """(N, 3) m/s, map axes, of (N, 3) points in the map frame on the bodies of (N,) ``ACTOR_DTYPE`` rows."""
    position_m, velocity_mps, angular_velocity_radps = (
        np.stack([actors[name] for name in names], axis=1).astype(np.float64)
        for names in (("x", "y", "z"), ("vx", "vy", "vz"), ("wx", "wy", "wz"))
    )
    return velocity_mps + np.cross(angular_velocity_radps, points_m - position_m)


def part_velocities(
    skeletons: Skeletons,
    before: Table,
    now: Table,
    elapsed_s: float,
    row: Int32Array,
    part: Int32Array,
    points_m: Float64Array,
) -> Float64Array:
    """Velocities of points on moving parts relative to the body that carries them.

    Args:
        skeletons: Kinematics of the catalog's models.
        before: (A,) ``ACTOR_DTYPE`` a tick ago; wheels, steering and gait have moved uniformly since.
        now: (A,) the same actors now.
        elapsed_s: Length of the tick.
        row: (N,) row of the actor of each point.
        part: (N,) part of each point, an index into the parts of its model.
        points_m: (N, 3) points, map frame.

    Returns:
        (N, 3) m/s, map axes.
    """
    moving, moving_index = np.unique(row, return_inverse=True)
    before, now = before[moving], now[moving]
    earlier, later = (interpolate_actors(before, now, 1.0 + step) for step in (-_STEP, _STEP))
    change = skeletons.poses(later) - skeletons.poses(earlier)
    rates = change @ inverse(skeletons.poses(now)) / (2.0 * _STEP * elapsed_s)
    actor, _ = skeletons.rows(now)
    rate = rates[np.searchsorted(actor, moving_index) + part]
    map_from_body = map_from_actors(now)[moving_index]
    points_body = np.einsum("nji,nj->ni", map_from_body[:, :3, :3], points_m - map_from_body[:, :3, 3])
    velocity_body_mps = np.einsum("nij,nj->ni", rate[:, :3, :3], points_body) + rate[:, :3, 3]
    return np.einsum("nij,nj->ni", map_from_body[:, :3, :3], velocity_body_mps)
