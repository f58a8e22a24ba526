"""Polygons as arrays, parted along straight lines all at once.

A line that crosses a ring twice parts it in two, which takes a few steps for all rings together (Sutherland and Hodgman
1974). Where it crosses more often, or runs along a side, shapely finds the parts.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
import shapely

from simbev_ros.types import AnyArray, BoolArray, Float64Array, Int64Array

_ON_LINE_M = 1e-9


@dataclass(frozen=True)
class Rings:
    """(P,) polygons without holes.

    Attributes:
        xy_m: (V, 2) vertices of one polygon after the other, each counter-clockwise.
        count: (P,) how many vertices each has.
        is_cut: (V,) whether the side from a vertex to the next is known to be new, and none of the area that was cut.
    """

    xy_m: Float64Array
    count: Int64Array
    is_cut: BoolArray

    @classmethod
    def of(cls, polygons: AnyArray) -> Self:
        """Those of (P,) shapely polygons; what holes they have is covered."""
        rings = shapely.get_exterior_ring(polygons)
        rings = np.where(shapely.is_ccw(rings), rings, shapely.reverse(rings))
        xy_m, owner = shapely.get_coordinates(rings, return_index=True)
        closing = np.append(owner[1:] != owner[:-1], True)[: len(owner)]
        count = np.bincount(owner, minlength=len(polygons)) - 1
        return cls(xy_m[~closing], count, np.full(len(xy_m) - len(polygons), False))

    @classmethod
    def joined(cls, *parts: "Rings") -> Self:
        """All of them, in order."""
        return cls(
            np.concatenate([part.xy_m for part in parts]),
            np.concatenate([part.count for part in parts]),
            np.concatenate([part.is_cut for part in parts]),
        )

    @cached_property
    def owner(self) -> Int64Array:
        """(V,) number of the polygon of each vertex."""
        return np.repeat(np.arange(len(self.count)), self.count)

    @cached_property
    def first(self) -> Int64Array:
        """(P,) number of each polygon's first vertex."""
        first: Int64Array = np.cumsum(self.count) - self.count
        return first

    @cached_property
    def following(self) -> Int64Array:
        """(V,) number of the next vertex of the same polygon."""
        following = np.arange(1, len(self.xy_m) + 1)
        following[self.first + self.count - 1] = self.first
        return following

    @property
    def area_m2(self) -> Float64Array:
        """(P,) areas."""
        from_first_m = self.xy_m - self.xy_m[self.first[self.owner]]
        twice_m2 = cross(from_first_m, from_first_m[self.following])
        area_m2: Float64Array = np.bincount(self.owner, twice_m2, len(self.count)) / 2.0
        return area_m2

    @property
    def polygons(self) -> AnyArray:
        """(P,) shapely polygons."""
        rings = shapely.linearrings(self.xy_m, indices=self.owner)
        return np.asarray(shapely.polygons(rings), object)

    def take(self, chosen: BoolArray) -> "Rings":
        """Those of a (P,) choice."""
        if chosen.all():
            return self
        vertices = chosen[self.owner]
        return Rings(self.xy_m[vertices], self.count[chosen], self.is_cut[vertices])


def parted(rings: Rings, line: Float64Array) -> tuple[Rings, Int64Array, BoolArray]:
    """Polygons parted along a line each.

    Args:
        rings: The polygons.
        line: (P, 3) a, b, c of the lines a x + b y = c, in the map frame; c may be infinite.

    Returns:
        The (Q,) parts, the number of the polygon that each is of, and whether it lies where a x + b y > c.
    """
    of_vertex = line[rings.owner]
    offset_m = np.einsum("ij,ij->i", of_vertex[:, :2], rings.xy_m) - of_vertex[:, 2]
    offset_m[np.abs(offset_m) < _ON_LINE_M] = 0.0
    is_above, is_below = (_any(side, rings) for side in (offset_m > 0.0, offset_m < 0.0))
    crossed = is_above & is_below
    if not crossed.any():
        return rings, np.arange(len(line)), is_above
    onward_m = offset_m[rings.following]
    rises, falls = (offset_m <= 0.0) & (onward_m > 0.0), (offset_m >= 0.0) & (onward_m < 0.0)
    turns = np.bincount(rings.owner[rises | falls], minlength=len(line))
    often = crossed & ((turns > 2) | _any((offset_m == 0.0) & (onward_m == 0.0), rings))
    once = crossed & ~often
    whole, halved, cut_up = (np.flatnonzero(chosen) for chosen in (~crossed, once, often))
    parts, origins, aboves = [rings.take(~crossed)], [whole], [is_above[whole]]
    for half, side in zip(_parted_once(rings.take(once), offset_m[once[rings.owner]]), (True, False), strict=True):
        parts.append(half)
        origins.append(halved)
        aboves.append(np.full(len(halved), side))
    if len(cut_up):
        for sign, side in ((1.0, True), (-1.0, False)):
            pieces, of_ring = _beyond(rings.take(often).polygons, sign * line[cut_up])
            parts.append(Rings.of(pieces))
            origins.append(cut_up[of_ring])
            aboves.append(np.full(len(of_ring), side))
    return Rings.joined(*parts), np.concatenate(origins), np.concatenate(aboves)


def without_holes(polygons: AnyArray) -> tuple[AnyArray, Int64Array]:
    """(P,) polygons, those with holes cut through them, and the number of each part's polygon."""
    origin = np.arange(len(polygons))
    holed = shapely.get_num_interior_rings(polygons) > 0
    while holed.any():
        line = _shorter_chord(polygons[holed], shapely.bounds(shapely.get_interior_ring(polygons[holed], 0)))
        sides = [_beyond(polygons[holed], sign * line) for sign in (1.0, -1.0)]
        origin = np.concatenate([origin[~holed], *(origin[holed][of_polygon] for _, of_polygon in sides)])
        polygons = np.concatenate([polygons[~holed], *(parts for parts, _ in sides)])
        holed = shapely.get_num_interior_rings(polygons) > 0
    return polygons, origin


def _shorter_chord(polygons: AnyArray, hole_m: Float64Array) -> Float64Array:
    """(P, 3) lines through the middles of holes of (P, 4) bounds, to the north or to the east: what cuts less."""
    middle_m = (hole_m[:, :2] + hole_m[:, 2:]) / 2.0
    low_m, high_m = np.split(shapely.bounds(polygons), 2, axis=1)
    lines, chords_m = [], []
    for axis in range(2):
        ends_m = np.stack([low_m, high_m], axis=1)
        ends_m[:, :, axis] = middle_m[:, None, axis]
        chords_m.append(shapely.length(shapely.intersection(polygons, shapely.linestrings(ends_m))))
        lines.append(np.column_stack([np.broadcast_to(np.eye(2)[axis], middle_m.shape), middle_m[:, axis]]))
    return np.where((chords_m[0] <= chords_m[1])[:, None], *lines)


def cross(a: Float64Array, b: Float64Array) -> Float64Array:
    """(N,) products of (N, 2) vectors: twice the area of the triangle between them, positive if it turns left."""
    product: Float64Array = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    return product


def _parted_once(rings: Rings, offset_m: Float64Array) -> tuple[Rings, Rings]:
    """What of rings that cross their line twice lies above, and what below; (V,) offsets of vertices from the lines."""
    onward_m = offset_m[rings.following]
    crosses = offset_m * onward_m < 0.0
    share = np.divide(offset_m, offset_m - onward_m, where=crosses, out=np.zeros(len(offset_m)))
    meets_m = rings.xy_m + share[:, None] * (rings.xy_m[rings.following] - rings.xy_m)
    xy_m = _in_turn(rings.xy_m, meets_m)
    owner = rings.owner.repeat(2)
    halves = []
    for sign in (1.0, -1.0):
        here_m, there_m = sign * offset_m, sign * onward_m
        kept = _in_turn(here_m >= 0.0, crosses)
        is_cut = _in_turn(rings.is_cut | ((here_m == 0.0) & (there_m < 0.0)), rings.is_cut | (there_m < 0.0))
        halves.append(Rings(xy_m[kept], np.bincount(owner[kept], minlength=len(rings.count)), is_cut[kept]))
    return halves[0], halves[1]


def _in_turn(first: AnyArray, second: AnyArray) -> AnyArray:
    """(2 N, …) rows of two arrays, one of each after the other."""
    rows = np.empty((len(first), 2, *first.shape[1:]), first.dtype)
    rows[:, 0], rows[:, 1] = first, second
    return rows.reshape(-1, *first.shape[1:])


def _beyond(polygons: AnyArray, line: Float64Array) -> tuple[AnyArray, Int64Array]:
    """The parts of (P,) polygons where a x + b y > c, and the number of the polygon of each."""
    line = line / np.linalg.norm(line[:, :2], axis=1, keepdims=True)
    near_m, reach_m = shapely.bounds(polygons)[:, :2], 2.0 * shapely.length(polygons)[:, None]
    foot_m = near_m - (np.sum(line[:, :2] * near_m, axis=1) - line[:, 2])[:, None] * line[:, :2]
    across_m, along_m = reach_m * line[:, :2], reach_m * line[:, 1::-1] * np.array([-1.0, 1.0])
    corners_m = [foot_m - along_m, foot_m + along_m, foot_m + along_m + across_m, foot_m - along_m + across_m]
    beyond = shapely.intersection(polygons, shapely.polygons(np.stack(corners_m, axis=1)))
    parts, of_polygon = shapely.get_parts(beyond, return_index=True)
    flat = shapely.get_type_id(parts) == shapely.GeometryType.POLYGON
    return parts[flat], of_polygon[flat]


def _any(of_vertex: BoolArray, rings: Rings) -> BoolArray:
    """(P,) which polygons have a vertex of a choice."""
    chosen = np.zeros(len(rings.count), bool)
    chosen[rings.owner[of_vertex]] = True
    return chosen
