"""The ground that actors stand on: the level at a point, the road's height there, and the sidewalks that rise above it.

Approximate heights, such as SUMO's, which lie on the lanes' center lines, tell the levels apart: a point is on a
structure if one of its strips covers the point in plan and is close to it in height, otherwise on the ground.
"""

from functools import cached_property

import numpy as np
import shapely

from simbev_ros.foundation.types import BoolArray, Float64Array, Int64Array
from simbev_ros.maps.roads.elevation import Elevation
from simbev_ros.maps.roads.lane_kind import PAVED_KINDS
from simbev_ros.maps.roads.layout import Layout
from simbev_ros.maps.roads.raised_lanes import RaisedLanes
from simbev_ros.maps.roads.surface import strip_polygons
from simbev_ros.simulation.world.kinematics.raised_areas import CELL_M, RaisedAreas

_LEVEL_TOLERANCE_M = 1.25  # half the clearance between two levels
_OVERHANG_M = 0.5  # distance by which wheels may stand beside the lanes of a structure
_PATCH_M = 32.0
_SEAM_M = 0.1  # half the gap between adjacent lanes that does not count


class GroundSurface:
    """The surfaces of a map's roads."""

    def __init__(self, layout: Layout, raised_areas: RaisedAreas | None = None) -> None:
        """For a layout; None: the raised areas are its sidewalks."""
        self._layout, self._raised_areas = layout, raised_areas or RaisedAreas(layout)
        self._elevation = Elevation(layout)
        self._raised_lanes = [RaisedLanes.of_level(layout, level) for level in layout.levels]
        raised = [strip for strip in layout.strips if strip.level > 0]
        self._deck_level = np.array([strip.level for strip in raised], np.int64)
        self._decks = shapely.STRtree(shapely.buffer(strip_polygons(raised), _OVERHANG_M))
        self._first_m, self._patches = _covered_patches(self._decks)

    @cached_property
    def is_level(self) -> bool:
        """Whether all roads lie at height 0, and no lane is raised by the map."""
        strips = self._layout.strips
        return not any(self._raised_lanes) and not any(
            side_m[:, 2].any() for strip in strips for side_m in (strip.left_m, strip.right_m)
        )

    def levels(self, point_m: Float64Array) -> Int64Array:
        """(N,) levels of (N, 3) points, map frame."""
        return self._levels_and_heights(point_m)[0]

    def _levels_and_heights(self, point_m: Float64Array) -> tuple[Int64Array, Float64Array]:
        """(N,) levels of (N, 3) points, and (N,) heights of the carriageway's plane where the level is not 0."""
        level, level_height_m = np.zeros(len(point_m), np.int64), np.zeros(len(point_m))
        near = np.flatnonzero(self._near_decks(point_m)) if len(self._deck_level) else level[:0]
        if not len(near):
            return level, level_height_m
        row, deck = self._decks.query(shapely.points(point_m[near, :2]), predicate="intersects")
        point = near[row]
        deck_level = self._deck_level[deck]
        nearest_m = np.full(len(point_m), _LEVEL_TOLERANCE_M)
        for number in np.unique(deck_level).tolist():
            rows = np.unique(point[deck_level == number])
            height_m = self._elevation.height_m(point_m[rows, :2], number)
            gap_m = np.abs(height_m - point_m[rows, 2])
            is_nearer = gap_m < nearest_m[rows]
            nearer = rows[is_nearer]
            level[nearer], nearest_m[nearer], level_height_m[nearer] = number, gap_m[is_nearer], height_m[is_nearer]
        return level, level_height_m

    def _near_decks(self, point_m: Float64Array) -> BoolArray:
        """(N,) whether (N, 3) points lie in patches with structures; a fast test that excludes most points."""
        patch = np.floor((point_m[:, :2] - self._first_m) / _PATCH_M).astype(np.int64) + 1
        column, row = np.clip(patch, 0, np.array(self._patches.shape) - 1).T
        return self._patches[column, row]

    def heights_m(self, point_m: Float64Array) -> Float64Array:
        """(N,) heights of the carriageway's plane, or of lanes that the map raises, at (N, 3) points."""
        level, height_m = self._levels_and_heights(point_m)
        rows = np.flatnonzero(level == 0)
        height_m[rows] = self._elevation.height_m(point_m[rows, :2])
        for number, lanes in enumerate(self._raised_lanes):
            if lanes:
                rows = np.flatnonzero(level == number)
                height_m[rows] += np.nan_to_num(lanes.rise_m(point_m[rows, :2]))
        return height_m

    def raised_m(self, point_m: Float64Array) -> Float64Array:
        """(N,) height of the ground above ``heights_m`` at (N, 3) points: the default height of sidewalks, or land."""
        cells = np.column_stack([self.levels(point_m), np.floor(point_m[:, :2] / CELL_M).astype(np.int64)])
        raised_m = np.zeros(len(point_m))
        for key in set(map(tuple, cells.tolist())):
            rows = (cells == key).all(axis=1)
            for area, height_m in self._raised_areas.in_cell(*key):
                raised_m[rows] = np.where(shapely.contains_xy(area, point_m[rows, :2]), height_m, raised_m[rows])
        return raised_m

    def is_paved(self, point_m: Float64Array) -> BoolArray:
        """(N,) whether (N, 3) points lie on a road or a shoulder, of any level."""
        paved = np.zeros(len(point_m), bool)
        paved[self._pavement.query(shapely.points(point_m[:, :2]), predicate="intersects")[0]] = True
        return paved

    @cached_property
    def _pavement(self) -> shapely.STRtree:
        return shapely.STRtree(shapely.buffer(strip_polygons(self._layout.strips_of(*PAVED_KINDS)), _SEAM_M))

    def prepare(self, point_m: Float64Array, reach_m: float) -> None:
        """Build the sidewalks within ``reach_m``, at most 512 m, of (N, 3) points now instead of on demand."""
        around = min(reach_m, CELL_M) * np.array([(x, y) for x in (-1, 0, 1) for y in (-1, 0, 1)])
        cells = np.floor((point_m[:, None, :2] + around) / CELL_M).astype(np.int64).reshape(-1, 2)
        for column, row in np.unique(cells, axis=0).tolist():
            for level in self._layout.levels:
                self._raised_areas.in_cell(level, column, row)


def _covered_patches(decks: shapely.STRtree) -> tuple[Float64Array, BoolArray]:
    """(2,) corner of a grid of patches, and a mask of those that decks touch, padded with an empty rim."""
    if not len(decks):
        return np.zeros(2), np.zeros((1, 1), bool)
    first_m, last_m = shapely.total_bounds(decks.geometries).reshape(2, 2)
    shape = np.floor((last_m - first_m) / _PATCH_M).astype(np.int64) + 1
    corner_m = first_m + _PATCH_M * np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1).reshape(-1, 2)
    touched = np.zeros(len(corner_m), bool)
    touched[decks.query(shapely.box(*corner_m.T, *(corner_m + _PATCH_M).T), predicate="intersects")[0]] = True
    return first_m, np.pad(touched.reshape(shape), 1)
