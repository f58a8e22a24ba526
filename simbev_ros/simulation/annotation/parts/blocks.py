"""Divides the triangles of an actor model into blocks of neighbors, so that most can be dropped by their bounds."""

import numpy as np

from simbev_ros.assets.actors.actor_model import ActorModel
from simbev_ros.foundation.geometry.ragged import ragged_indices
from simbev_ros.foundation.types import Float32Array, Int64Array

BLOCK = 8
"""Triangles per block: smaller blocks are dropped more often, but there are more of them."""

_LARGE_M = 0.15
"""Triangles larger than this have blocks of their own, so that those of small ones stay small."""

_VOXEL_M = 0.02
_SPREAD = ((np.arange(1 << 10)[:, None] >> np.arange(10) & 1) << 3 * np.arange(10)).sum(axis=1)
"""Voxels that follow each other in Morton order are neighbors: numbers of 10 bits, with two zeros after each bit."""


def blocks(model: ActorModel) -> list[Float32Array]:
    """The triangles of each part in blocks, (C, 3 B, 4) homogeneous: first, second and third corners of B triangles.

    A block that is not full repeats its last triangle.
    """
    mesh = model.mesh
    corners_m = mesh.vertices[mesh.triangles]
    low_m, high_m = corners_m.min(axis=1), corners_m.max(axis=1)
    part, is_large = mesh.part[mesh.triangles[:, 0]], (high_m - low_m).max(axis=1) > _LARGE_M
    order = np.lexsort((_morton((low_m + high_m) / 2), is_large, part))
    group = 2 * part[order].astype(np.int64) + is_large[order]
    first = np.flatnonzero(np.diff(group, prepend=-1))
    end = np.append(first[1:], len(order))
    of_group, number = ragged_indices(-(-(end - first) // BLOCK))
    index = np.minimum((first[of_group] + number * BLOCK)[:, None] + np.arange(BLOCK), end[of_group, None] - 1)
    points_m = corners_m[order[index]].swapaxes(1, 2).reshape(-1, 3 * BLOCK, 3)
    homogeneous = np.concatenate([points_m, np.ones_like(points_m[:, :, :1])], axis=2)
    ends = np.cumsum(np.bincount(group[first[of_group]] // 2, minlength=len(model.parts)))
    return np.split(homogeneous, ends[:-1])


def block_bounds(model: ActorModel) -> list[Float32Array]:
    """(C, 6) centers and half extents of the bounds of the blocks of each part."""
    bounds = []
    for corners_m in blocks(model):
        low_m, high_m = corners_m[:, :, :3].min(axis=1), corners_m[:, :, :3].max(axis=1)
        bounds.append(np.concatenate([(low_m + high_m) / 2, (high_m - low_m) / 2], axis=1))
    return bounds


def _morton(points_m: Float32Array) -> Int64Array:
    """(T,) Morton codes of (T, 3) points: neighbors in space have mostly similar codes."""
    lowest_m = points_m.min(axis=0, initial=np.inf)
    x, y, z = ((points_m - lowest_m) / _VOXEL_M).astype(np.int64).clip(max=len(_SPREAD) - 1).T
    return _SPREAD[x] | _SPREAD[y] << 1 | _SPREAD[z] << 2
