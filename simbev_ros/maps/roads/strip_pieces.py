"""Cuts strips into short pieces and finds which pieces lie above, below and beside each other."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import shapely

from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.types import AnyArray, BoolArray, Float64Array, Int64Array
from simbev_ros.maps.roads.layout import Strip
from simbev_ros.maps.roads.polylines import Polylines

_TOUCH_DISTANCE_M = 0.3
_HEIGHT_TOLERANCE_M = 1.0
_MIN_OVERLAP_M2 = 0.3


@dataclass(frozen=True)
class StripPieces:
    """N pieces of strips, in the order of the strips and along them.

    Attributes:
        strips: The strips that were cut.
        row: (N,) index of each piece's strip.
        start_m: (N,) station along its strip's center line at which the piece begins.
        end_m: (N,) station at which it ends.
    """

    strips: Sequence[Strip]
    row: Int64Array
    start_m: Float64Array
    end_m: Float64Array

    @staticmethod
    def cut(strips: Sequence[Strip], length_m: float) -> "StripPieces":
        """Cut strips into equal pieces of at most ``length_m``; strips with an outline are not cut."""
        lines = Polylines.from_lines([strip.center_m for strip in strips])
        max_length_m = np.where([strip.outline_m is None for strip in strips], length_m, np.inf)
        row, station_m = lines.sample_stations(max_length_m)
        starts = np.flatnonzero(row[1:] == row[:-1])
        return StripPieces(strips, row[starts], station_m[starts], station_m[starts + 1])

    def widen(self, margin_m: float) -> "StripPieces":
        """The same pieces widened by ``margin_m`` on both sides; those with an outline are unchanged."""
        strips = []
        for strip in self.strips:
            across_m = strip.left_m[:, :2] - strip.right_m[:, :2]
            step_m = np.zeros_like(strip.left_m)
            step_m[:, :2] = across_m * (margin_m / np.maximum(np.linalg.norm(across_m, axis=1), 1e-3))[:, None]
            strips.append(replace(strip, left_m=strip.left_m + step_m, right_m=strip.right_m - step_m))
        return replace(self, strips=strips)

    def divide(self, piece: Int64Array, stations_m: Float64Array) -> "StripPieces":
        """Divide pieces at stations along their strips, (K,) each, which must not be at their ends."""
        row = np.concatenate([self.row, self.row[piece]])
        start_m = np.concatenate([self.start_m, stations_m])
        order = np.lexsort([start_m, row])
        row, start_m = row[order], start_m[order]
        last = np.append(row[1:] != row[:-1], True)
        end_m = np.where(last, self.lines.length_m[row], np.append(start_m[1:], 0.0))
        is_nonempty = end_m > start_m
        return StripPieces(self.strips, row[is_nonempty], start_m[is_nonempty], end_m[is_nonempty])

    @cached_property
    def lines(self) -> Polylines:
        """Center lines of the strips."""
        return Polylines.from_lines([strip.center_m for strip in self.strips])

    @cached_property
    def polygons(self) -> AnyArray:
        """(N,) areas, shapely."""
        left_m, right_m = (
            np.concatenate([np.empty((0, 3)), *sides_m])
            for sides_m in ([strip.left_m for strip in self.strips], [strip.right_m for strip in self.strips])
        )
        parameters = self._parameters(0.0), self._parameters(0.5), self._parameters(1.0)
        lefts_m, rights_m = (
            [self.lines.values(parameter, side_m)[:, :2] for parameter in parameters] for side_m in (left_m, right_m)
        )
        polygons = np.asarray(shapely.polygons(np.stack([*lefts_m, *reversed(rights_m)], axis=1)), object)
        for piece in np.flatnonzero(self._has_outline[self.row]).tolist():
            polygons[piece] = shapely.Polygon(self.strips[self.row[piece]].outline_m)
        is_invalid = ~shapely.is_valid(polygons)
        polygons[is_invalid] = shapely.make_valid(polygons[is_invalid])
        return polygons

    @cached_property
    def center_m(self) -> Float64Array:
        """(N, 3) midpoints, map frame."""
        return self.lines.values(self._parameters(0.5))

    @cached_property
    def heading(self) -> Float64Array:
        """(N, 2) unit vectors along the pieces; zero for strips that are described by an outline."""
        return np.asarray(np.where(self._has_outline[self.row, None], 0.0, self.lines.headings(self._parameters(0.5))))

    @cached_property
    def half_width_m(self) -> Float64Array:
        """(N,) half the widths of the pieces in plan view."""
        sides_m = [strip.left_m[:, :2] - strip.right_m[:, :2] for strip in self.strips]
        width_m = np.linalg.norm(np.concatenate([np.empty((0, 2)), *sides_m]), axis=1)
        return self.lines.values(self._parameters(0.5), width_m) / 2.0

    def position_m(self, fraction: float) -> Float64Array:
        """(N, 3) positions on the center lines, map frame: ``fraction`` 0 is the start of each piece, 1 its end."""
        return self.lines.values(self._parameters(fraction))

    def _parameters(self, fraction: float) -> Float64Array:
        """The positions of ``position_m`` as parameters of ``lines``."""
        return self.lines.parameter(self.row, self.start_m + fraction * (self.end_m - self.start_m))

    @cached_property
    def _has_outline(self) -> BoolArray:
        """(S,) whether a strip is described by an outline."""
        return np.array([strip.outline_m is not None for strip in self.strips], bool)

    def __len__(self) -> int:
        return len(self.row)

    @cached_property
    def tree(self) -> shapely.STRtree:
        """Search tree of the polygons."""
        return shapely.STRtree(self.polygons)

    @cached_property
    def height_range_m(self) -> tuple[Float64Array, Float64Array]:
        """(N,) lowest and (N,) highest point of the pieces' center lines."""
        heights_m = np.stack([self.position_m(fraction)[:, 2] for fraction in (0.0, 0.5, 1.0)])
        return heights_m.min(axis=0), heights_m.max(axis=0)

    def boxes_overlap(self) -> Int64Array:
        """(2, K) pairs of pieces, each in both orders, whose bounds in plan view overlap; a piece overlaps itself."""
        return np.asarray(self.tree.query(self.polygons), np.int64)

    def within(self, distance_m: float, sources: Int64Array) -> Int64Array:
        """(K,) pieces with bounds within a distance of the bounds of the source pieces."""
        bounds_m = shapely.bounds(self.polygons[sources]) + distance_m * np.array([-1.0, -1.0, 1.0, 1.0])
        return np.unique(self.tree.query(np.asarray(shapely.box(*bounds_m.T), object))[1])

    def overpass_pairs(self, clearance_m: float) -> Int64Array:
        """(2, K) pairs of pieces, the first passing over the second with more than ``clearance_m`` between them."""
        upper, lower = self.boxes_overlap()
        separated = self.center_m[upper, 2] - self.center_m[lower, 2] > clearance_m
        upper, lower = upper[separated], lower[separated]
        crossing = _overlap_m2(self.polygons[upper], self.polygons[lower]) > _MIN_OVERLAP_M2
        return np.stack([upper[crossing], lower[crossing]])

    def contact_pairs(self, candidates: Int64Array) -> Int64Array:
        """(2, K) pairs of ``candidates`` that touch at the same height, each pair once."""
        bounds_m = shapely.bounds(self.polygons[candidates]) + _TOUCH_DISTANCE_M * np.array([-1.0, -1.0, 1.0, 1.0])
        boxes = np.asarray(shapely.box(*bounds_m.T), object)
        first, second = candidates[shapely.STRtree(boxes).query(self.polygons[candidates])]
        same_height = np.abs(self.center_m[first, 2] - self.center_m[second, 2]) < _HEIGHT_TOLERANCE_M
        first, second = first[same_height & (first < second)], second[same_height & (first < second)]
        touches = shapely.dwithin(self.polygons[first], self.polygons[second], _TOUCH_DISTANCE_M)
        return np.stack([first[touches], second[touches]])

    def parallel(self, piece: Int64Array, direction: Float64Array) -> BoolArray:
        """(K,) whether pieces run along (K, 2) unit vectors or (2,) one, in either direction, within 20°."""
        return np.abs(np.sum(self.heading[piece] * direction, axis=1)) > np.cos(np.radians(20.0))

    def path_lengths_m(self, first: Int64Array, second: Int64Array) -> Float64Array:
        """(K,) path lengths along the road between touching pieces; 0 to a piece beside, or across in a junction."""
        step_m = self.center_m[second, :2] - self.center_m[first, :2]
        along_m = [np.abs(np.sum(step_m * self.heading[piece], axis=1)) for piece in (first, second)]
        length_m = np.maximum(*along_m)
        not_parallel = np.flatnonzero(~self.parallel(first, self.heading[second]))
        crossing = (
            _overlap_m2(self.polygons[first[not_parallel]], self.polygons[second[not_parallel]]) > _MIN_OVERLAP_M2
        )
        length_m[not_parallel[crossing]] = 0.0
        return np.asarray(length_m)


def _overlap_m2(polygons_a: AnyArray, polygons_b: AnyArray) -> Float64Array:
    """(K,) common area of pairs of polygons."""
    return shapely.area(overlay.intersection(polygons_a, polygons_b))
