"""The objects that a map prescribes in and near a region, which replace generated ones of their kind."""

from collections.abc import Sequence

import numpy as np
import shapely
from scipy.spatial import cKDTree

from simbev_ros.foundation.types import BoolArray, Float64Array
from simbev_ros.maps.land_features import MapObject, ObjectKind

REPLACED_M = 80.0
"""Distance from an object of the map up to which no others of its kind are generated."""

TREE_KINDS = (ObjectKind.TREE, ObjectKind.CONIFER, ObjectKind.PALM)

_SPACING_M = 20.0


class NearbyObjects:
    """The objects of a map within ``REPLACED_M`` of an area.

    Attributes:
        items: The objects, in the order of the map.
    """

    def __init__(self, objects: Sequence[MapObject], area: shapely.Polygon) -> None:
        self.items: tuple[MapObject, ...] = ()
        self._trees: dict[ObjectKind, cKDTree] = {}
        if not objects:
            return
        corners_m = np.concatenate([item.points_m[:, :2] for item in objects])
        starts = np.cumsum([0, *(len(item.points_m) for item in objects)])[:-1]
        low_m, high_m = (edge.reduceat(corners_m, starts) for edge in (np.minimum, np.maximum))
        x0, y0, x1, y1 = area.bounds
        near = (low_m <= np.array([x1, y1]) + REPLACED_M) & (high_m >= np.array([x0, y0]) - REPLACED_M)
        self.items = tuple(objects[row] for row in np.flatnonzero(near.all(axis=1)).tolist())
        for kind in {item.kind for item in self.items}:
            points_m = [_stations_m(item) for item in self.items if item.kind is kind]
            self._trees[kind] = cKDTree(np.concatenate(points_m))

    def replace(self, kinds: Sequence[ObjectKind], xy_m: Float64Array) -> BoolArray:
        """(N,) whether (N, 2) points are near an object of any of these kinds."""
        replaced = np.full(len(xy_m), False)
        for kind in kinds:
            if kind in self._trees and len(xy_m):
                replaced |= self._trees[kind].query(xy_m, distance_upper_bound=REPLACED_M)[0] < np.inf
        return replaced


def _stations_m(item: MapObject) -> Float64Array:
    """(N, 2) points along an object."""
    if len(item.points_m) == 1:
        return item.points_m[:, :2]
    return shapely.get_coordinates(shapely.segmentize(shapely.LineString(item.points_m[:, :2]), _SPACING_M))
