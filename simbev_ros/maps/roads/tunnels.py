"""Tunnels as tubes around their lanes: which points lie inside, and how far from a portal.

A tube is a box: it stands on the outer borders of the tunnel's lanes and is as high as its clearance.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely
from scipy.spatial import cKDTree

from simbev_ros.foundation.types import AnyArray, BoolArray, Float64Array
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import Layout, Strip
from simbev_ros.maps.roads.polylines import Polylines
from simbev_ros.maps.roads.surface import strip_polygons

CLEARANCE_M = 5.0
"""Height of a tunnel's ceiling above the carriageway's plane."""

ROOF_M = 5.6
"""Height of the top of a tunnel's structure above the carriageway's plane."""

WALL_M = 0.4
"""Thickness of a tunnel's walls."""

_LAMP_SPACING_M = 9.0
_SPACING_M = 4.0
_SIDE_M = 0.3  # between lanes and walls there may be a gap that surfaces close
_BELOW_M, _ABOVE_M = 1.0, 0.3
_BEYOND_M = 0.6


@dataclass(frozen=True)
class Tunnels:
    """The tunnels of a map, in short pieces of lanes.

    Attributes:
        corners_m: (Q, 4, 3) corners of the pieces on the carriageway's plane, map frame: right start, right end, left
            end, left start.
        portals_m: (P, 2, 3) ends of lines across single lanes at portals.
        lamps_m: (L, 3) lamps at the ceiling, map frame.
    """

    corners_m: Float64Array
    portals_m: Float64Array
    lamps_m: Float64Array

    @classmethod
    def none(cls) -> "Tunnels":
        """The tunnels of a map that has none."""
        return cls(np.empty((0, 4, 3)), np.empty((0, 2, 3)), np.empty((0, 3)))

    @classmethod
    def of_layout(cls, layout: Layout) -> "Tunnels":
        """The tunnels of a layout with assigned levels."""
        strips = [strip for strip in layout.strips if strip.tunnel and strip.outline_m is None]
        corners_m = np.concatenate([np.empty((0, 4, 3)), *map(_corners_m, strips)])
        if not strips:
            return cls.none()
        portals_m = portals_of([strip for strip in layout.strips if strip.tunnel])
        return cls(corners_m, portals_m, np.concatenate([lamps_along(strip)[0] for strip in strips]))

    def __bool__(self) -> bool:
        return len(self.corners_m) > 0

    def holds(self, xyz_m: Float64Array) -> BoolArray:
        """(N,) whether (N, 3) points of the map frame lie inside a tunnel."""
        inside = np.zeros(len(xyz_m), bool)
        if self:
            point, piece = self._tree.query(shapely.points(xyz_m[:, :2]), predicate="dwithin", distance=_SIDE_M)
            above_m = xyz_m[point, 2] - self.corners_m[piece, :, 2].mean(axis=1)
            inside[point[(above_m > -_BELOW_M) & (above_m < CLEARANCE_M + _ABOVE_M)]] = True
        return inside

    def depths_m(self, xyz_m: Float64Array) -> Float64Array:
        """(N,) distances in plan from (N, 3) points inside tunnels to the nearest portal; 0 outside of tunnels."""
        return np.where(self.holds(xyz_m), self.portal_distances_m(xyz_m), 0.0)

    def portal_distances_m(self, xyz_m: Float64Array) -> Float64Array:
        """(N,) distances in plan from (N, 3) points to the middle of the nearest lane at a portal; infinite if none."""
        if len(self.portals_m) == 0:
            return np.full(len(xyz_m), np.inf)
        return np.asarray(cKDTree(self.portals_m.mean(axis=1)[:, :2]).query(xyz_m[:, :2])[0], np.float64)

    @cached_property
    def _tree(self) -> shapely.STRtree:
        polygons: AnyArray = np.asarray(shapely.polygons(self.corners_m[..., :2]), object)
        return shapely.STRtree(shapely.make_valid(polygons))


def lamps_along(strip: Strip) -> tuple[Float64Array, Float64Array]:
    """(L, 3) lamps at the ceiling above a driving lane in a tunnel, map frame, and (L,) headings; else none."""
    if strip.kind is not LaneKind.DRIVING or strip.outline_m is not None:
        return np.empty((0, 3)), np.empty(0)
    lines = Polylines.from_lines([strip.center_m])
    count = max(1, round(float(lines.length_m[0]) / _LAMP_SPACING_M))
    parameter = lines.parameter(np.zeros(count, np.int64), (np.arange(count) + 0.5) / count * lines.length_m[0])
    heading = lines.headings(parameter)
    ceiling_m = np.array([0.0, 0.0, CLEARANCE_M])
    return lines.values(parameter) + ceiling_m, np.arctan2(heading[:, 1], heading[:, 0])


def _corners_m(strip: Strip) -> Float64Array:
    """(Q, 4, 3) corners of pieces of a strip."""
    station_m = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(strip.center_m[:, :2], axis=0), axis=1)))
    at_m = np.linspace(0.0, station_m[-1], int(np.ceil(station_m[-1] / _SPACING_M)) + 1)
    at_m = np.unique(np.concatenate([at_m, station_m]))
    left_m, right_m = (
        np.column_stack([np.interp(at_m, station_m, axis_m) for axis_m in side_m.T])
        for side_m in (strip.left_m, strip.right_m)
    )
    return np.stack([right_m[:-1], right_m[1:], left_m[1:], left_m[:-1]], axis=1)


def portals_of(strips: Sequence[Strip]) -> Float64Array:
    """(P, 2, 3) borders of lanes where these strips in tunnels end and no other one of them continues, map frame."""
    drawn = [strip for strip in strips if strip.outline_m is None]
    if not drawn:
        return np.empty((0, 2, 3))
    ends_m = np.array([[strip.left_m[k], strip.right_m[k]] for strip in drawn for k in (0, -1)])
    middle_m = ends_m.mean(axis=1)[:, :2]
    before_m = np.array([strip.center_m[k] for strip in drawn for k in (1, -2)])[:, :2]
    outward = middle_m - before_m
    outward /= np.maximum(np.linalg.norm(outward, axis=1, keepdims=True), 1e-6)
    beyond = np.asarray(shapely.points(middle_m + _BEYOND_M * outward), object)
    end, strip = shapely.STRtree(strip_polygons(strips)).query(beyond, predicate="intersects")
    low_m, high_m = (np.array([extreme(each.center_m[:, 2]) for each in strips]) for extreme in (np.min, np.max))
    height_m = ends_m.mean(axis=1)[end, 2]
    is_near = (height_m > low_m[strip] - CLEARANCE_M / 2.0) & (height_m < high_m[strip] + CLEARANCE_M / 2.0)
    return np.asarray(np.delete(ends_m, end[is_near], axis=0))
