"""Broad phase of casting rays against actors: finds which rays pass through the boxes around actors' parts.

The boxes form a small Embree scene that is built for each tick.
"""

from dataclasses import dataclass

import numpy as np

from simbev_ros.foundation.types import Float32Array, Float64Array, Int64Array
from simbev_ros.simulation.raycast.embree import TriangleSet

CORNERS = np.array([[x, y, z] for z in (-1.0, 1.0) for y in (-1.0, 1.0) for x in (-1.0, 1.0)])
"""(8, 3) corners of a box with half sizes of 1."""

_QUADS = np.array([[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]])
_FACES = np.concatenate([_QUADS[:, [0, 1, 2]], _QUADS[:, [0, 2, 3]]])
"""(12, 3) outward-facing triangles between these corners."""

_MIN_THICKNESS_M = 1e-4


@dataclass(frozen=True, slots=True)
class Passages:
    """Pairs of a ray and a box that it enters before its limit, ascending by ray, then by box; each pair once.

    Attributes:
        ray: (K,) int64 index of the ray.
        box: (K,) int64 index of the box.
    """

    ray: Int64Array
    box: Int64Array


class PartBoxes:
    """Boxes around the parts of actors at one tick, for testing rays against them."""

    def __init__(self, corners_m: Float64Array) -> None:
        """Build the Embree scene from (B, 8, 3) corners, meters, in the order of ``CORNERS``."""
        self._count = len(corners_m)
        triangles = (_FACES + 8 * np.arange(self._count)[:, None, None]).reshape(-1, 3).astype(np.int32)
        self._faces = TriangleSet(corners_m.reshape(-1, 3).astype(np.float32), triangles)

    def passages(self, rays: Float32Array, limit_m: Float32Array) -> Passages:
        """Find the boxes that (N, 6) rays (origin in meters, unit direction) enter before (N,) ranges in meters."""
        first = self._faces.cast(rays)
        touched = np.flatnonzero(first.triangle >= 0)
        # A ray that starts inside a box passes it, whatever the range of the box's wall.
        leaving = np.einsum("ni,ni->n", first.normal[touched], rays[touched, 3:]) > 0
        chosen = touched[leaving | (first.range_m[touched] < limit_m[touched])]
        crossings = self._faces.crossings(rays[chosen])
        pair = crossings.ray * self._count + crossings.triangle // len(_FACES)
        order = np.argsort(pair, kind="stable")
        pair, range_m = pair[order], crossings.range_m[order]
        starts = np.flatnonzero(np.diff(pair, prepend=-1))
        enter_m, leave_m = (
            extreme.reduceat(range_m, starts) if len(starts) else range_m for extreme in (np.minimum, np.maximum)
        )
        # A ray that starts in a box only leaves it, possibly through two triangles at their common edge.
        entry_m = np.where(leave_m - enter_m > _MIN_THICKNESS_M, enter_m, np.float32(0.0))
        ray, box = np.divmod(pair[starts], max(self._count, 1))
        ray = chosen[ray]
        near = entry_m < limit_m[ray]
        return Passages(ray[near], box[near])
