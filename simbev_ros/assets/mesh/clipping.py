"""Splits many polygons along straight lines in one vectorized step.

A line that crosses a ring twice splits it in two, in a few array operations for all rings together (Sutherland and
Hodgman 1974). Where a line crosses a ring more often, or runs along one of its sides, shapely computes the parts.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
import shapely

from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.geometry.plan_view import indexed_polygon_parts, left_of
from simbev_ros.foundation.geometry.ragged import ragged_starts
from simbev_ros.foundation.types import AnyArray, BoolArray, Float64Array, Int64Array

_ON_LINE_TOLERANCE_M = 1e-9


@dataclass(frozen=True)
class Rings:
    """(P,) polygons without holes, as a ragged array of vertices.

    Attributes:
        xy_m: (V, 2) vertices, polygon by polygon, each counter-clockwise.
        count: (P,) number of vertices of each polygon.
        is_cut: (V,) whether the side from a vertex to the next is known to come from a cut, not from the original area.
    """

    xy_m: Float64Array
    count: Int64Array
    is_cut: BoolArray

    @classmethod
    def from_polygons(cls, polygons: AnyArray) -> Self:
        """Create rings from the exteriors of (P,) shapely polygons; holes are filled."""
        rings = shapely.get_exterior_ring(polygons)
        rings = np.where(shapely.is_ccw(rings), rings, shapely.reverse(rings))
        xy_m, owner = shapely.get_coordinates(rings, return_index=True)
        closing = np.append(owner[1:] != owner[:-1], True)[: len(owner)]
        count = np.bincount(owner, minlength=len(polygons)) - 1
        return cls(xy_m[~closing], count, np.full(len(xy_m) - len(polygons), False))

    @classmethod
    def concatenate(cls, *parts: "Rings") -> Self:
        """Concatenate several sets of rings, in order."""
        return cls(
            np.concatenate([part.xy_m for part in parts]),
            np.concatenate([part.count for part in parts]),
            np.concatenate([part.is_cut for part in parts]),
        )

    @cached_property
    def owner(self) -> Int64Array:
        """(V,) index of the polygon of each vertex."""
        return np.repeat(np.arange(len(self.count)), self.count)

    @cached_property
    def first(self) -> Int64Array:
        """(P,) index of each polygon's first vertex."""
        return ragged_starts(self.count)

    @cached_property
    def following(self) -> Int64Array:
        """(V,) index of the next vertex of the same polygon."""
        following = np.arange(1, len(self.xy_m) + 1)
        following[self.first + self.count - 1] = self.first
        return following

    @property
    def area_m2(self) -> Float64Array:
        """(P,) areas in m²."""
        from_first_m = self.xy_m - self.xy_m[self.first[self.owner]]
        twice_m2 = cross(from_first_m, from_first_m[self.following])
        return np.bincount(self.owner, twice_m2, len(self.count)) / 2.0

    @property
    def polygons(self) -> AnyArray:
        """(P,) shapely polygons."""
        rings = shapely.linearrings(self.xy_m, indices=self.owner)
        return np.asarray(shapely.polygons(rings), object)

    def take(self, chosen: BoolArray) -> "Rings":
        """Select the rings of a (P,) mask."""
        if chosen.all():
            return self
        vertices = chosen[self.owner]
        return Rings(self.xy_m[vertices], self.count[chosen], self.is_cut[vertices])


def split_along_lines(rings: Rings, line: Float64Array) -> tuple[Rings, Int64Array, BoolArray]:
    """Split each polygon along its own line.

    Args:
        rings: (P,) polygons.
        line: (P, 3) a, b, c of the lines a x + b y = c, in the map frame; c may be infinite.

    Returns:
        The (Q,) parts, the (Q,) index of each part's polygon, and (Q,) whether the part lies where a x + b y > c.
    """
    of_vertex = line[rings.owner]
    offset_m = np.einsum("ij,ij->i", of_vertex[:, :2], rings.xy_m) - of_vertex[:, 2]
    offset_m[np.abs(offset_m) < _ON_LINE_TOLERANCE_M] = 0.0
    is_above, is_below = (_any_vertex(side, rings) for side in (offset_m > 0.0, offset_m < 0.0))
    crossed = is_above & is_below
    if not crossed.any():
        return rings, np.arange(len(line)), is_above
    onward_m = offset_m[rings.following]
    rises, falls = (offset_m <= 0.0) & (onward_m > 0.0), (offset_m >= 0.0) & (onward_m < 0.0)
    sign_changes = np.bincount(rings.owner[rises | falls], minlength=len(line))
    cut_repeatedly = crossed & ((sign_changes > 2) | _any_vertex((offset_m == 0.0) & (onward_m == 0.0), rings))
    cut_once = crossed & ~cut_repeatedly
    whole_index, halved_index, split_index = (np.flatnonzero(chosen) for chosen in (~crossed, cut_once, cut_repeatedly))
    parts, origins, aboves = [rings.take(~crossed)], [whole_index], [is_above[whole_index]]
    for half, side in zip(
        _split_once(rings.take(cut_once), offset_m[cut_once[rings.owner]]), (True, False), strict=True
    ):
        parts.append(half)
        origins.append(halved_index)
        aboves.append(np.full(len(halved_index), side))
    if len(split_index):
        for sign, side in ((1.0, True), (-1.0, False)):
            pieces, of_ring = _parts_beyond(rings.take(cut_repeatedly).polygons, sign * line[split_index])
            parts.append(Rings.from_polygons(pieces))
            origins.append(split_index[of_ring])
            aboves.append(np.full(len(of_ring), side))
    return Rings.concatenate(*parts), np.concatenate(origins), np.concatenate(aboves)


def without_holes(polygons: AnyArray) -> tuple[AnyArray, Int64Array]:
    """Cut (P,) polygons through their holes until none has any; returns the parts and the polygon index of each."""
    origin = np.arange(len(polygons))
    holed = shapely.get_num_interior_rings(polygons) > 0
    while holed.any():
        line = _shorter_chord(polygons[holed], shapely.bounds(shapely.get_interior_ring(polygons[holed], 0)))
        sides = [_parts_beyond(polygons[holed], sign * line) for sign in (1.0, -1.0)]
        origin = np.concatenate([origin[~holed], *(origin[holed][of_polygon] for _, of_polygon in sides)])
        polygons = np.concatenate([polygons[~holed], *(parts for parts, _ in sides)])
        holed = shapely.get_num_interior_rings(polygons) > 0
    return polygons, origin


def _shorter_chord(polygons: AnyArray, hole_m: Float64Array) -> Float64Array:
    """(P, 3) lines through the centers of holes with (P, 4) bounds: northward or eastward, whichever cut is shorter."""
    middle_m = (hole_m[:, :2] + hole_m[:, 2:]) / 2.0
    low_m, high_m = np.split(shapely.bounds(polygons), 2, axis=1)
    lines, chords_m = [], []
    for axis in range(2):
        ends_m = np.stack([low_m, high_m], axis=1)
        ends_m[:, :, axis] = middle_m[:, None, axis]
        chords_m.append(shapely.length(overlay.intersection(polygons, shapely.linestrings(ends_m))))
        lines.append(np.column_stack([np.broadcast_to(np.eye(2)[axis], middle_m.shape), middle_m[:, axis]]))
    return np.where((chords_m[0] <= chords_m[1])[:, None], *lines)


def cross(a: Float64Array, b: Float64Array) -> Float64Array:
    """(N,) cross products of (N, 2) vectors: twice the area of their triangle, positive for a turn to the left."""
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def _split_once(rings: Rings, offset_m: Float64Array) -> tuple[Rings, Rings]:
    """The parts above and below of rings that cross their line twice, given (V,) signed offsets from the lines."""
    onward_m = offset_m[rings.following]
    crosses = offset_m * onward_m < 0.0
    share = np.divide(offset_m, offset_m - onward_m, where=crosses, out=np.zeros(len(offset_m)))
    crossing_m = rings.xy_m + share[:, None] * (rings.xy_m[rings.following] - rings.xy_m)
    xy_m = _interleave(rings.xy_m, crossing_m)
    owner = rings.owner.repeat(2)
    halves = []
    for sign in (1.0, -1.0):
        here_m, there_m = sign * offset_m, sign * onward_m
        kept = _interleave(here_m >= 0.0, crosses)
        is_cut = _interleave(rings.is_cut | ((here_m == 0.0) & (there_m < 0.0)), rings.is_cut | (there_m < 0.0))
        halves.append(Rings(xy_m[kept], np.bincount(owner[kept], minlength=len(rings.count)), is_cut[kept]))
    return halves[0], halves[1]


def _interleave(first: AnyArray, second: AnyArray) -> AnyArray:
    """(2 N, …) rows of two (N, …) arrays, alternating."""
    rows = np.empty((len(first), 2, *first.shape[1:]), first.dtype)
    rows[:, 0], rows[:, 1] = first, second
    return rows.reshape(-1, *first.shape[1:])


def _parts_beyond(polygons: AnyArray, line: Float64Array) -> tuple[AnyArray, Int64Array]:
    """The parts of (P,) polygons where a x + b y > c, and the index of each part's polygon."""
    line = line / np.linalg.norm(line[:, :2], axis=1, keepdims=True)
    near_m, reach_m = shapely.bounds(polygons)[:, :2], 2.0 * shapely.length(polygons)[:, None]
    foot_m = near_m - (np.sum(line[:, :2] * near_m, axis=1) - line[:, 2])[:, None] * line[:, :2]
    across_m, along_m = reach_m * line[:, :2], reach_m * left_of(line)
    corners_m = [foot_m - along_m, foot_m + along_m, foot_m + along_m + across_m, foot_m - along_m + across_m]
    return indexed_polygon_parts(overlay.intersection(polygons, shapely.polygons(np.stack(corners_m, axis=1))))


def _any_vertex(of_vertex: BoolArray, rings: Rings) -> BoolArray:
    """(P,) whether a polygon has any vertex of a (V,) mask."""
    chosen = np.zeros(len(rings.count), bool)
    chosen[rings.owner[of_vertex]] = True
    return chosen
