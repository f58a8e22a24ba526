"""Carves water into the terrain: beds below the water surface and banks beside it."""

from collections.abc import Sequence

import numpy as np
import shapely
from scipy.spatial import cKDTree

from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.land_features import Water

_MAX_DEPTH_M = 3.0
_BANK_SLOPE = 0.5  # above and below the surface, so that the shoreline is smooth
_FREEBOARD_M = 0.25  # minimum height of the land above the water beside it, so that nothing is flooded
_BANK_M = (4.0, 24.0)  # between these distances the bank blends into the original terrain
_SHORE_SPACING_M = 0.25


class Shores:
    """The shores of all water areas of a map."""

    def __init__(self, waters: Sequence[Water]) -> None:
        self._shores = [_Shore(water) for water in waters]

    def carve(self, xy_m: Float64Array, land_m: Float64Array) -> Float64Array:
        """Carve banks and beds into the (N,) terrain heights at (N, 2) points, given as they would be without water."""
        x_m, y_m = xy_m.T
        for shore in self._shores:
            low, high = shore.bounds_m[:2] - _BANK_M[1], shore.bounds_m[2:] + _BANK_M[1]
            near = np.flatnonzero((x_m >= low[0]) & (x_m <= high[0]) & (y_m >= low[1]) & (y_m <= high[1]))
            if len(near):
                land_m = land_m.copy()
                land_m[near] = shore.carve_one(xy_m[near], land_m[near])
        return land_m


class _Shore:
    """The shore of one water area."""

    def __init__(self, water: Water) -> None:
        self.bounds_m: Float64Array = np.array(water.area.bounds)
        self._area, self._surface_m = water.area, water.surface_m
        shapely.prepare(self._area)
        self._line = cKDTree(shapely.get_coordinates(shapely.segmentize(water.area.boundary, _SHORE_SPACING_M)))

    def carve_one(self, xy_m: Float64Array, land_m: Float64Array) -> Float64Array:
        """Carve one water area; arguments as for ``Shores.carve``."""
        distance_m: Float64Array = np.minimum(self._line.query(xy_m, distance_upper_bound=_BANK_M[1])[0], _BANK_M[1])
        inside = shapely.contains_xy(self._area, xy_m[:, 0], xy_m[:, 1])
        bed_m = np.minimum(land_m, self._surface_m - np.minimum(_BANK_SLOPE * distance_m, _MAX_DEPTH_M))
        rise_m = _BANK_SLOPE * distance_m
        bank_m = self._surface_m + np.clip(land_m - self._surface_m, np.minimum(_FREEBOARD_M, rise_m), rise_m)
        share = np.clip((distance_m - _BANK_M[0]) / (_BANK_M[1] - _BANK_M[0]), 0.0, 1.0)
        share = share**2 * (3.0 - 2.0 * share)
        return np.where(inside, bed_m, bank_m + share * (land_m - bank_m))
