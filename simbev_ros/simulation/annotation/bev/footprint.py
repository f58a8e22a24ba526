"""Footprint of labeled surfaces: their triangles in plan view, each with the BEV class that it is drawn as."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from simbev_ros.foundation.types import AnyArray, BoolArray, Float64Array, Int32Array, Int64Array, UInt8Array


@dataclass(frozen=True, eq=False, slots=True, weakref_slot=True)
class Footprint:
    """(V, 2) points in meters, map frame, (T, 3) point indices, and (T,) the plane that each triangle is drawn into.

    Footprints compare by identity, so that they can be keys of weak caches.
    """

    points_m: Float64Array
    triangles: Int32Array
    planes: UInt8Array

    @property
    def polygons(self) -> AnyArray:
        """(T,) the triangles as shapely polygons."""
        return np.asarray(shapely.polygons(self.points_m[self.triangles]), object)

    def subset(self, triangles: BoolArray) -> "Footprint":
        """The triangles where the (T,) mask is True, and the points that they use."""
        used, indices = np.unique(self.triangles[triangles], return_inverse=True)
        return Footprint(self.points_m[used], indices.reshape(-1, 3).astype(np.int32), self.planes[triangles])


def merge_footprints(footprints: Sequence[Footprint]) -> Footprint:
    """Concatenate footprints, in order."""
    starts: Int64Array = np.cumsum([0, *(len(each.points_m) for each in footprints)])
    return Footprint(
        np.concatenate([np.empty((0, 2)), *(each.points_m for each in footprints)]),
        np.concatenate(
            [
                np.empty((0, 3), np.int32),
                *(each.triangles + np.int32(start) for each, start in zip(footprints, starts, strict=False)),
            ]
        ),
        np.concatenate([np.empty(0, np.uint8), *(each.planes for each in footprints)]),
    )
