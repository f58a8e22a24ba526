"""Velocities of points on actors: that of the body, and what wheels, steering and limbs add to it."""

from collections.abc import Sequence

import numpy as np

from simbev_ros.assets.actor_model import ActorModel, part_poses
from simbev_ros.geometry.transforms import inverse
from simbev_ros.raycast.between import actors_between
from simbev_ros.scene.state import map_from_actors
from simbev_ros.types import Float64Array, Int32Array, Table

_STEP = 0.01
"""Share of a tick over which poses are differentiated: wheels turn by a few hundredths of a radian then."""


def body_velocities(actors: Table, points_m: Float64Array) -> Float64Array:
    """(N, 3) m/s, map axes, of (N, 3) points in the map frame on the bodies of (N,) ``ACTOR_DTYPE`` rows."""
    place_m, velocity_mps, spin_radps = (
        np.stack([actors[name] for name in names], axis=1).astype(np.float64)
        for names in (("x", "y", "z"), ("vx", "vy", "vz"), ("wx", "wy", "wz"))
    )
    return velocity_mps + np.cross(spin_radps, points_m - place_m)


def part_velocities(
    models: Sequence[ActorModel],
    before: Table,
    now: Table,
    elapsed_s: float,
    row: Int32Array,
    part: Int32Array,
    points_m: Float64Array,
) -> Float64Array:
    """Velocities of points on moving parts relative to the body that carries them.

    Args:
        models: The catalogue's models, indexed by blueprint.
        before: (A,) ``ACTOR_DTYPE`` a tick ago; wheels, steering and gait have turned evenly since.
        now: (A,) the same actors now.
        elapsed_s: Length of the tick.
        row: (N,) row of the actor of each point.
        part: (N,) the part.
        points_m: (N, 3) map frame.

    Returns:
        (N, 3) m/s, map axes.
    """
    velocity_mps = np.zeros((len(row), 3))
    map_from_body = map_from_actors(now)[row]
    points_body = np.einsum("nji,nj->ni", map_from_body[:, :3, :3], points_m - map_from_body[:, :3, 3])
    soon, just_before = (actors_between(before, now, 1.0 + step) for step in (_STEP, -_STEP))
    for blueprint in np.unique(now["blueprint"][row]):
        actors = np.flatnonzero(now["blueprint"] == blueprint)
        poses_then, poses, poses_soon = (
            part_poses(models[blueprint], table[actors]) for table in (just_before, now, soon)
        )
        rates = (poses_soon - poses_then) @ inverse(poses) / (2.0 * _STEP * elapsed_s)
        mine = np.flatnonzero(now["blueprint"][row] == blueprint)
        rate = rates[np.searchsorted(actors, row[mine]), part[mine]]
        velocity_mps[mine] = np.einsum("nij,nj->ni", rate[:, :3, :3], points_body[mine]) + rate[:, :3, 3]
    rotated_mps: Float64Array = np.einsum("nij,nj->ni", map_from_body[:, :3, :3], velocity_mps)
    return rotated_mps
