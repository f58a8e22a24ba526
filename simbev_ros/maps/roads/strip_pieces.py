"""Strips cut into short pieces, and what lies above, beneath and beside each piece."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import shapely

from simbev_ros.maps.roads.layout import Strip
from simbev_ros.maps.roads.polylines import Polylines
from simbev_ros.types import AnyArray, BoolArray, Float64Array, Int64Array

_TOUCHING_M = 0.3
_SAME_HEIGHT_M = 1.0
_OVERLAP_M2 = 0.3


@dataclass(frozen=True)
class StripPieces:
    """Pieces of strips, in the order of the strips and along them.

    Attributes:
        strips: What was cut.
        row: (N,) strip of each piece.
        start_m: (N,) where the piece begins along its strip's center line.
        end_m: (N,) where it ends.
    """

    strips: Sequence[Strip]
    row: Int64Array
    start_m: Float64Array
    end_m: Float64Array

    @staticmethod
    def of(strips: Sequence[Strip], length_m: float) -> "StripPieces":
        """Cut strips into equal pieces of at most ``length_m``; those with an outline stay whole."""
        lines = Polylines.of([strip.center_m for strip in strips])
        longest_m = np.where([strip.outline_m is None for strip in strips], length_m, np.inf)
        row, place_m = lines.places(longest_m)
        starts = np.flatnonzero(row[1:] == row[:-1])
        return StripPieces(strips, row[starts], place_m[starts], place_m[starts + 1])

    def widened(self, margin_m: float) -> "StripPieces":
        """The same pieces, reaching so much further to both sides; those with an outline as they are."""
        strips = []
        for strip in self.strips:
            across_m = strip.left_m[:, :2] - strip.right_m[:, :2]
            step_m = np.zeros_like(strip.left_m)
            step_m[:, :2] = across_m * (margin_m / np.maximum(np.linalg.norm(across_m, axis=1), 1e-3))[:, None]
            strips.append(replace(strip, left_m=strip.left_m + step_m, right_m=strip.right_m - step_m))
        return replace(self, strips=strips)

    def divided(self, piece: Int64Array, at_m: Float64Array) -> "StripPieces":
        """With pieces divided at places along their strips, (K,) each, not at their ends."""
        row = np.concatenate([self.row, self.row[piece]])
        start_m = np.concatenate([self.start_m, at_m])
        order = np.lexsort([start_m, row])
        row, start_m = row[order], start_m[order]
        last = np.append(row[1:] != row[:-1], True)
        end_m = np.where(last, self.lines.length_m[row], np.append(start_m[1:], 0.0))
        some = end_m > start_m
        return StripPieces(self.strips, row[some], start_m[some], end_m[some])

    @cached_property
    def lines(self) -> Polylines:
        """Center lines of the strips."""
        return Polylines.of([strip.center_m for strip in self.strips])

    @cached_property
    def polygons(self) -> AnyArray:
        """(N,) areas, shapely."""
        left_m, right_m = (
            np.concatenate([np.empty((0, 3)), *sides_m])
            for sides_m in ([strip.left_m for strip in self.strips], [strip.right_m for strip in self.strips])
        )
        at = self._at(0.0), self._at(0.5), self._at(1.0)
        lefts_m, rights_m = ([self.lines.values(place, side_m)[:, :2] for place in at] for side_m in (left_m, right_m))
        polygons = np.asarray(shapely.polygons(np.stack([*lefts_m, *reversed(rights_m)], axis=1)), object)
        for piece in np.flatnonzero(self._whole[self.row]).tolist():
            polygons[piece] = shapely.Polygon(self.strips[self.row[piece]].outline_m)
        wrong = ~shapely.is_valid(polygons)
        polygons[wrong] = shapely.make_valid(polygons[wrong])
        return polygons

    @cached_property
    def center_m(self) -> Float64Array:
        """(N, 3) middles, map frame."""
        return self.lines.values(self._at(0.5))

    @cached_property
    def heading(self) -> Float64Array:
        """(N, 2) unit vectors along them; zero where a strip is described by an outline."""
        return np.asarray(np.where(self._whole[self.row, None], 0.0, self.lines.headings(self._at(0.5))))

    @cached_property
    def half_width_m(self) -> Float64Array:
        """(N,) half their widths, in the ground plane."""
        sides_m = [strip.left_m[:, :2] - strip.right_m[:, :2] for strip in self.strips]
        width_m = np.linalg.norm(np.concatenate([np.empty((0, 2)), *sides_m]), axis=1)
        return self.lines.values(self._at(0.5), width_m) / 2.0

    def place_m(self, part: float) -> Float64Array:
        """(N, 3) places on the center lines, map frame: 0 at the start of each piece, 1 at its end."""
        return self.lines.values(self._at(part))

    def _at(self, part: float) -> Float64Array:
        """As ``place_m``, as parameters of ``lines``."""
        return self.lines.parameter(self.row, self.start_m + part * (self.end_m - self.start_m))

    @cached_property
    def _whole(self) -> BoolArray:
        """(S,) whether a strip is described by an outline."""
        return np.array([strip.outline_m is not None for strip in self.strips], bool)

    def __len__(self) -> int:
        return len(self.row)

    @cached_property
    def tree(self) -> shapely.STRtree:
        """Of the polygons."""
        return shapely.STRtree(self.polygons)

    @cached_property
    def height_range_m(self) -> tuple[Float64Array, Float64Array]:
        """(N,) lowest and (N,) highest point of their center lines."""
        heights_m = np.stack([self.place_m(part)[:, 2] for part in (0.0, 0.5, 1.0)])
        return heights_m.min(axis=0), heights_m.max(axis=0)

    def boxes_overlap(self) -> Int64Array:
        """(2, K) pairs of pieces, each in both orders, whose bounds in plan overlap; a piece overlaps itself."""
        return np.asarray(self.tree.query(self.polygons), np.int64)

    def within(self, distance_m: float, sources: Int64Array) -> Int64Array:
        """(K,) pieces whose bounds come so near to those of some pieces."""
        bounds_m = shapely.bounds(self.polygons[sources]) + distance_m * np.array([-1.0, -1.0, 1.0, 1.0])
        return np.unique(self.tree.query(np.asarray(shapely.box(*bounds_m.T), object))[1])

    def stacked(self, clearance_m: float) -> Int64Array:
        """(2, K) pairs of pieces, the first passing over the second with more than ``clearance_m`` between them."""
        upper, lower = self.boxes_overlap()
        apart = self.center_m[upper, 2] - self.center_m[lower, 2] > clearance_m
        upper, lower = upper[apart], lower[apart]
        crossing = _overlap_m2(self.polygons[upper], self.polygons[lower]) > _OVERLAP_M2
        return np.stack([upper[crossing], lower[crossing]])

    def contacts(self, among: Int64Array) -> Int64Array:
        """(2, K) pairs of pieces that touch at the same height, each once, of those that ``among`` names."""
        bounds_m = shapely.bounds(self.polygons[among]) + _TOUCHING_M * np.array([-1.0, -1.0, 1.0, 1.0])
        boxes = np.asarray(shapely.box(*bounds_m.T), object)
        first, second = among[shapely.STRtree(boxes).query(self.polygons[among])]
        level = np.abs(self.center_m[first, 2] - self.center_m[second, 2]) < _SAME_HEIGHT_M
        first, second = first[level & (first < second)], second[level & (first < second)]
        touching = shapely.dwithin(self.polygons[first], self.polygons[second], _TOUCHING_M)
        return np.stack([first[touching], second[touching]])

    def parallel(self, piece: Int64Array, direction: Float64Array) -> BoolArray:
        """(K,) whether pieces run along (K, 2) unit vectors or (2,) one, either way, within 20°."""
        along: BoolArray = np.abs(np.sum(self.heading[piece] * direction, axis=1)) > np.cos(np.radians(20.0))
        return along

    def ways_m(self, first: Int64Array, second: Int64Array) -> Float64Array:
        """(K,) ways along the road between pieces that touch: none to one beside it or, in junctions, across it."""
        step_m = self.center_m[second, :2] - self.center_m[first, :2]
        ahead_m = [np.abs(np.sum(step_m * self.heading[piece], axis=1)) for piece in (first, second)]
        way_m = np.maximum(*ahead_m)
        askew = np.flatnonzero(~self.parallel(first, self.heading[second]))
        crossing = _overlap_m2(self.polygons[first[askew]], self.polygons[second[askew]]) > _OVERLAP_M2
        way_m[askew[crossing]] = 0.0
        return np.asarray(way_m)


def _overlap_m2(polygons_a: AnyArray, polygons_b: AnyArray) -> Float64Array:
    """(K,) common area of pairs of polygons."""
    common_m2: Float64Array = shapely.area(shapely.intersection(polygons_a, polygons_b))
    return common_m2
