"""Shadows of actors in headlight beams: distance from each headlamp to the nearest actor, per direction."""

import numpy as np

from simbev_ros.foundation.types import BoolArray, Float32Array, Float64Array, Table

DIRECTIONS = 128
HALF_ANGLE_RAD = 1.2
"""Directions are spaced evenly over this angle to either side of the lamp's axis."""

FREE_M = 1e4
"""Distance where no actor blocks the light."""

_FAR_M = 70.0
_MAX_HEIGHT_GAP_M = 3.0  # the light misses actors that stand higher or lower than this
_SHRINK_M = 0.3  # actors are shrunk by this much, so that their side facing the lamp is lit


def free_distances(lamps: Table, actors: Table, origin_m: Float64Array) -> Float32Array:
    """(N, 128) meters from (N,) ``LAMP_DTYPE`` headlamps to the nearest actor's box, seen from above."""
    position_m = np.stack([actors["x"], actors["y"], actors["z"]], axis=1) - origin_m
    half_m = np.stack([actors["length"], actors["width"]], axis=1) / 2.0
    half_m = np.maximum(half_m - _SHRINK_M, 0.6 * half_m)
    result = np.full((len(lamps), DIRECTIONS), FREE_M, np.float32)
    lamp, actor = np.nonzero(_may_hit(lamps, actors, position_m, half_m))
    if len(lamp):
        turn = np.linspace(-HALF_ANGLE_RAD, HALF_ANGLE_RAD, 2 * DIRECTIONS + 1)[1::2]
        facing = np.arctan2(lamps["facing"][lamp, 1], lamps["facing"][lamp, 0])
        angle = (facing - actors["yaw"][actor])[:, None] + turn
        offset_m = lamps["at"][lamp, :2] - position_m[actor, :2]
        cos, sin = np.cos(actors["yaw"][actor]), np.sin(actors["yaw"][actor])
        along_m = np.stack(
            [offset_m[:, 0] * cos + offset_m[:, 1] * sin, offset_m[:, 1] * cos - offset_m[:, 0] * sin], 1
        )
        distance_m = _entry(along_m, np.stack([np.cos(angle), np.sin(angle)], axis=1), half_m[actor])
        first = np.flatnonzero(np.diff(lamp, prepend=-1))
        result[lamp[first]] = np.minimum.reduceat(distance_m, first)
    return result


def _may_hit(lamps: Table, actors: Table, position_m: Float64Array, half_m: Float64Array) -> BoolArray:
    """(N, A) whether an actor may be in a lamp's light; its own vehicle and the riders on it never are."""
    offset_m = position_m - lamps["at"][:, None]
    radius_m = np.linalg.norm(half_m, axis=1)
    ahead_m = np.einsum("nac,nc->na", offset_m[..., :2], lamps["facing"][:, :2])
    own = actors["id"][lamps["row"]][:, None]
    near: BoolArray = np.linalg.norm(offset_m[..., :2], axis=2) < _FAR_M + radius_m
    near &= (ahead_m > -radius_m) & (np.abs(offset_m[..., 2]) < _MAX_HEIGHT_GAP_M)
    near &= (actors["id"] != own) & (actors["parent"] != own)
    return near


def _entry(start_m: Float64Array, direction: Float64Array, half_m: Float64Array) -> Float64Array:
    """(P, D) distance at which rays from (P, 2) points in (P, 2, D) directions enter boxes of (P, 2) half sizes."""
    nonzero = np.where(np.abs(direction) < 1e-9, 1e-9, direction)
    sides = [(side * half_m - start_m)[:, :, None] / nonzero for side in (-1.0, 1.0)]
    enters = np.minimum(*sides).max(axis=1)
    leaves = np.maximum(*sides).min(axis=1)
    return np.where(leaves > np.maximum(enters, 0.0), np.maximum(enters, 0.0), FREE_M)
