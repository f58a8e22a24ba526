"""Lanes whose height above the carriageway's plane the map states, such as low curbs and raised bicycle lanes."""

from collections.abc import Sequence
from functools import cached_property

import numpy as np
import shapely

from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.types import AnyArray, Float64Array, Int64Array
from simbev_ros.maps.roads.layout import Layout, Strip

_ON_EDGE_M = 1e-6


class RaisedLanes:
    """Surfaces of raised strips, cut into quadrilaterals between neighboring points of their borders.

    Attributes:
        strips: The strips.
        quads: (Q,) the quadrilaterals in plan view, shapely.
    """

    def __init__(self, strips: Sequence[Strip]) -> None:
        """Cut strips; all must have ``raised_m``."""
        self.strips = tuple(strips)
        self._corners_m = np.concatenate([np.empty((0, 4, 3)), *map(_corners_m, strips)])
        self.quads: AnyArray = np.asarray(shapely.polygons(self._corners_m[..., :2]), object)

    @classmethod
    def of_level(cls, layout: Layout, level: int) -> "RaisedLanes":
        """The raised lanes of one level of a layout."""
        return cls([strip for strip in layout.strips if strip.raised_m is not None and strip.level == level])

    def __bool__(self) -> bool:
        return len(self.quads) > 0

    @cached_property
    def area(self) -> shapely.Geometry:
        """Their common area in plan view."""
        return overlay.union_all(shapely.make_valid(self.quads))

    def rise_m(self, xy_m: Float64Array) -> Float64Array:
        """(N,) heights above the carriageway's plane at (N, 2) points; NaN where no lane is raised."""
        rise_m = np.full(len(xy_m), np.nan)
        if self:
            point, quad = self._tree.query(shapely.points(xy_m), predicate="dwithin", distance=_ON_EDGE_M)
            rise_m[point] = self._rise_on_m(quad, xy_m[point])
        return rise_m

    def nearest_rise_m(self, xy_m: Float64Array) -> Float64Array:
        """(N,) heights above the carriageway's plane of the quadrilaterals nearest to (N, 2) points."""
        point, quad = self._tree.query_nearest(shapely.points(xy_m), all_matches=False)
        rise_m = np.empty(len(xy_m))
        rise_m[point] = self._rise_on_m(quad, xy_m[point])
        return rise_m

    def _rise_on_m(self, quad: Int64Array, xy_m: Float64Array) -> Float64Array:
        """(N,) heights of (N,) quadrilaterals at (N, 2) points on or beside them."""
        right_start, right_end, left_end, left_start = np.moveaxis(self._corners_m[quad], 1, 0)
        along = _share(xy_m, (left_start + right_start) / 2.0, (left_end + right_end) / 2.0)[:, None]
        left, right = left_start + along * (left_end - left_start), right_start + along * (right_end - right_start)
        return np.asarray(right[:, 2] + _share(xy_m, right, left) * (left[:, 2] - right[:, 2]))

    @cached_property
    def _tree(self) -> shapely.STRtree:
        return shapely.STRtree(self.quads)


def _corners_m(strip: Strip) -> Float64Array:
    """(Q, 4, 3) corners in plan with heights above the plane: right start, right end, left end, left start."""
    assert strip.raised_m is not None
    left_m, right_m = (
        np.column_stack([side_m[:, :2], rise_m])
        for side_m, rise_m in zip((strip.left_m, strip.right_m), strip.raised_m.T, strict=True)
    )
    return np.stack([right_m[:-1], right_m[1:], left_m[1:], left_m[:-1]], axis=1)


def _share(xy_m: Float64Array, start_m: Float64Array, end_m: Float64Array) -> Float64Array:
    """(N,) positions between (N, 3) starts and ends, 0 to 1, of the points nearest to (N, 2) points."""
    step_m = (end_m - start_m)[:, :2]
    length2 = np.maximum(np.sum(step_m**2, axis=1), 1e-12)
    return np.asarray(np.clip(np.sum((xy_m - start_m[:, :2]) * step_m, axis=1) / length2, 0.0, 1.0))
