"""Registry of occupied footprints: each object claims its footprint, and none may overlap an earlier claim."""

from collections import defaultdict

import numpy as np
import shapely
from scipy.spatial import cKDTree
from shapely.geometry.base import BaseGeometry

from simbev_ros.foundation.types import BoolArray, Float64Array

_CELL_M = 24.0
_DISC_QUADRANT_SEGMENTS = 2
_MAX_RECENT = 400  # claims that are not in the search tree yet, before it is built again


class Claims:
    """Claimed footprints in plan, map frame, meters, indexed by the grid cells that their bounds touch."""

    def __init__(self) -> None:
        self._footprints: list[BaseGeometry] = []
        self._bounds: list[tuple[float, float, float, float]] = []
        self._cells: dict[tuple[int, int], list[int]] = defaultdict(list)
        self._tree = shapely.STRtree([])

    def is_free(self, footprint: BaseGeometry) -> bool:
        """Whether a footprint neither overlaps nor touches any claimed one."""
        x0, y0, x1, y1 = footprint.bounds
        near = set()
        for cell in _cells(footprint.bounds):
            for k in self._cells.get(cell, ()):
                a0, b0, a1, b1 = self._bounds[k]
                if a0 <= x1 and a1 >= x0 and b0 <= y1 and b1 >= y0:
                    near.add(k)
        return not any(self._footprints[k].intersects(footprint) for k in sorted(near))

    def add(self, *footprints: BaseGeometry) -> None:
        """Claim footprints unconditionally, even if they overlap others."""
        for footprint in footprints:
            if footprint.is_empty:
                continue
            for cell in _cells(footprint.bounds):
                self._cells[cell].append(len(self._footprints))
            self._footprints.append(footprint)
            self._bounds.append(footprint.bounds)

    def claim(self, footprint: BaseGeometry) -> bool:
        """Claim a footprint if it is free; return whether it was."""
        free = self.is_free(footprint)
        if free:
            self.add(footprint)
        return free

    def claim_discs(self, xy_m: Float64Array, radius_m: Float64Array) -> BoolArray:
        """Claim those of (N,) discs at (N, 2) positions that are free, earlier ones first; return which, (N,)."""
        free = self._clear_of_claims(xy_m, radius_m)
        kept = np.flatnonzero(free)
        free[kept] = _keep_disjoint(xy_m[kept], radius_m[kept])
        chosen = np.flatnonzero(free)
        self.add(*shapely.buffer(shapely.points(xy_m[chosen]), radius_m[chosen], quad_segs=_DISC_QUADRANT_SEGMENTS))
        return free

    def _clear_of_claims(self, xy_m: Float64Array, radius_m: Float64Array) -> BoolArray:
        """(N,) whether each disc touches no claimed footprint."""
        free = np.full(len(xy_m), True)
        if len(xy_m) == 0 or not self._footprints:
            return free
        if len(self._footprints) - len(self._tree) > _MAX_RECENT:
            self._tree = shapely.STRtree(self._footprints)
        points = shapely.points(xy_m)
        for tree in (self._tree, shapely.STRtree(self._footprints[len(self._tree) :])):
            free[tree.query(points, predicate="dwithin", distance=radius_m)[0]] = False
        return free


def _keep_disjoint(xy_m: Float64Array, radius_m: Float64Array) -> BoolArray:
    """(N,) greedy selection of disjoint discs: each is kept unless it touches one kept before."""
    kept = np.full(len(xy_m), True)
    if len(xy_m) < 2:
        return kept
    pairs = cKDTree(xy_m).query_pairs(2.0 * float(radius_m.max()), output_type="ndarray")
    gap_m = np.linalg.norm(xy_m[pairs[:, 0]] - xy_m[pairs[:, 1]], axis=1)
    pairs = pairs[gap_m < radius_m[pairs].sum(axis=1)]
    pairs = pairs[np.lexsort((pairs[:, 0], pairs[:, 1]))]
    for first, second in pairs.tolist():
        if kept[first]:
            kept[second] = False
    return kept


def _cells(bounds_m: tuple[float, float, float, float]) -> list[tuple[int, int]]:
    """Grid cells that bounds touch."""
    i0, j0, i1, j1 = (int(value // _CELL_M) for value in bounds_m)
    return [(i, j) for i in range(i0, i1 + 1) for j in range(j0, j1 + 1)]
