"""Finds how lanelets relate: which follow, adjoin and overlap each other.

As in the Lanelet2 library, a lanelet follows another where the end points of both bounds coincide, and adjoins it where
they share a bound.
"""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.files.limits import MAX_LANELET_PAIRS
from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.geometry.geodesy import MapDatum
from simbev_ros.maps.lanelet2.shapes import LaneletShape
from simbev_ros.maps.osm.driving_side import keeps_left
from simbev_ros.maps.roads.lane_kind import LaneKind

_CHUNK = 256
_CLEARANCE_M = 0.3
_SAME_LEVEL_M = 3.0
_VEHICLES = (LaneKind.DRIVING, LaneKind.BICYCLE)


@dataclass(frozen=True)
class Topology:
    """Relations of lanelets, by id.

    Attributes:
        shapes: The lanelets, crosswalks excepted; walkways beside a road in the direction of its outermost lane.
        left_hand: Traffic keeps to the left.
        following: Lanelets that follow each one.
        left: The lanelet beyond the left bound in the same direction, for lanelets that have exactly one.
        opposite: Lanelet → a lanelet in the opposite direction beyond the bound towards oncoming traffic.
        conflicts: Lanelets for vehicles that each one overlaps on its level, without adjoining it.
    """

    shapes: Mapping[str, LaneletShape]
    left_hand: bool
    following: Mapping[str, tuple[str, ...]]
    left: Mapping[str, str]
    opposite: Mapping[str, str]
    conflicts: Mapping[str, tuple[str, ...]]

    @cached_property
    def preceding(self) -> Mapping[str, tuple[str, ...]]:
        """Lanelets that each one follows."""
        found: dict[str, list[str]] = defaultdict(list)
        for before, after in self.following.items():
            for each in after:
                found[each].append(before)
        return {name: tuple(found.get(name, ())) for name in self.shapes}

    @cached_property
    def right(self) -> Mapping[str, str]:
        """The lanelet beyond the right bound in the same direction."""
        return {left: name for name, left in self.left.items()}

    @cached_property
    def carriageways(self) -> tuple[tuple[str, ...], ...]:
        """Lanelets side by side in one direction, each group from left to right."""
        groups = []
        for name in self.shapes:
            if name not in self.left:
                group = [name]
                while group[-1] in self.right:
                    group.append(self.right[group[-1]])
                groups.append(tuple(group))
        return tuple(groups)


def topology_of(path: Path, all_shapes: Sequence[LaneletShape], datum: MapDatum) -> Topology:
    """Relations of the lanelets of a file.

    Args:
        path: The file, named in errors.
        all_shapes: The lanelets.
        datum: Datum of the map frame: its country decides the side of traffic if no lanelets are oncoming.

    Raises:
        InputError: More pairs of lanelets follow or overlap each other than ``limits.MAX_LANELET_PAIRS``.
    """
    lanes = {shape.id: shape for shape in all_shapes if shape.kind is not LaneKind.CROSSING}
    left_hand = _left_hand(lanes.values(), datum)
    shapes = _with_walkways_aligned(lanes)
    left = _left_neighbors(shapes)
    return Topology(
        shapes=shapes,
        left_hand=left_hand,
        following=_following(path, shapes),
        left=left,
        opposite=_opposite(shapes, left_hand),
        conflicts=_conflicts(path, shapes, left),
    )


def _left_hand(shapes: Iterable[LaneletShape], datum: MapDatum) -> bool:
    """Whether oncoming lanelets are mostly on the right, by length of the bounds that they share; else by country."""
    driven = [shape for shape in shapes if shape.kind is LaneKind.DRIVING]
    lefts = {shape.left_nodes for shape in driven}
    rights = {shape.right_nodes for shape in driven}
    on_left_m = sum(shape.length_m for shape in driven if shape.left_nodes[::-1] in lefts)
    on_right_m = sum(shape.length_m for shape in driven if shape.right_nodes[::-1] in rights)
    if on_right_m == on_left_m:
        return keeps_left(datum.longitude_deg, datum.latitude_deg)
    return on_right_m > on_left_m


def _with_walkways_aligned(shapes: Mapping[str, LaneletShape]) -> dict[str, LaneletShape]:
    """All lanelets; walkways that adjoin a lane against its direction are turned around."""
    outer = {side for shape in shapes.values() if shape.kind is not LaneKind.SIDEWALK for side in _sides(shape)}
    return {
        name: shape.reversed()
        if shape.kind is LaneKind.SIDEWALK and not _is_beside(shape, outer) and _is_beside(shape.reversed(), outer)
        else shape
        for name, shape in shapes.items()
    }


def _sides(shape: LaneletShape) -> tuple[tuple[str, tuple[int, ...]], tuple[str, tuple[int, ...]]]:
    """The bounds of a lanelet, named as its neighbors in the same direction see them."""
    return ("right", shape.left_nodes), ("left", shape.right_nodes)


def _is_beside(shape: LaneletShape, sides: set[tuple[str, tuple[int, ...]]]) -> bool:
    """Whether a lanelet has a neighbor in the same direction."""
    return ("left", shape.left_nodes) in sides or ("right", shape.right_nodes) in sides


def _following(path: Path, shapes: Mapping[str, LaneletShape]) -> dict[str, tuple[str, ...]]:
    """Lanelets for the same kind of traffic that start where each one ends."""
    starts: dict[tuple[int, int], list[str]] = defaultdict(list)
    for name, shape in shapes.items():
        starts[shape.start].append(name)
    if sum(len(starts.get(shape.end, ())) for shape in shapes.values()) > MAX_LANELET_PAIRS:
        raise InputError(f"{path}: more than {MAX_LANELET_PAIRS} pairs of lanelets follow each other")
    return {
        name: tuple(after for after in starts.get(shape.end, ()) if shapes[after].kind is shape.kind and after != name)
        for name, shape in shapes.items()
    }


def _left_neighbors(shapes: Mapping[str, LaneletShape]) -> dict[str, str]:
    """Lanelet → the one whose right bound is its left bound; only where both have no other such neighbor."""
    by_right, by_left = defaultdict(list), defaultdict(list)
    for name, shape in shapes.items():
        by_right[shape.right_nodes].append(name)
        by_left[shape.left_nodes].append(name)
    return {
        names[0]: by_right[nodes][0]
        for nodes, names in by_left.items()
        if len(names) == 1 and len(by_right.get(nodes, ())) == 1 and by_right[nodes] != names
    }


def _opposite(shapes: Mapping[str, LaneletShape], left_hand: bool) -> dict[str, str]:
    """Lanelet → one in the opposite direction that shares its bound towards oncoming traffic."""
    bounds = {name: shape.right_nodes if left_hand else shape.left_nodes for name, shape in shapes.items()}
    by_bound = {nodes: name for name, nodes in reversed(bounds.items())}
    return {name: by_bound[nodes[::-1]] for name, nodes in bounds.items() if by_bound.get(nodes[::-1], name) != name}


def _conflicts(path: Path, shapes: Mapping[str, LaneletShape], left: Mapping[str, str]) -> dict[str, tuple[str, ...]]:
    """Lanelets for vehicles that overlap each one on its level by more than a few decimeters, neighbors excepted."""
    driven = [shape for shape in shapes.values() if shape.kind in _VEHICLES]
    areas = shapely.buffer([shape.polygon for shape in driven], -_CLEARANCE_M, join_style="mitre", quad_segs=1)
    tree = shapely.STRtree(areas)
    found: dict[str, list[str]] = defaultdict(list)
    count = 0
    for first in range(0, len(driven), _CHUNK):
        rows, others = tree.query(areas[first : first + _CHUNK], predicate="intersects")
        count += len(rows)
        if count > MAX_LANELET_PAIRS:
            raise InputError(f"{path}: more than {MAX_LANELET_PAIRS} pairs of lanelets overlap each other")
        for row, other in zip((rows + first).tolist(), others.tolist(), strict=True):
            one, two = driven[row], driven[other]
            if row < other and not _adjoin(one, two, left) and _on_same_level(one, two, areas[row], areas[other]):
                found[one.id].append(two.id)
                found[two.id].append(one.id)
    return {name: tuple(found.get(name, ())) for name in shapes}


def _adjoin(one: LaneletShape, two: LaneletShape, left: Mapping[str, str]) -> bool:
    """Whether two lanelets are neighbors, one follows the other, or both are the two directions of one lane."""
    are_neighbors = left.get(one.id) == two.id or left.get(two.id) == one.id
    is_two_way = one.left_nodes == two.right_nodes[::-1] and one.right_nodes == two.left_nodes[::-1]
    return are_neighbors or is_two_way or one.end == two.start or two.end == one.start


def _on_same_level(one: LaneletShape, two: LaneletShape, area_one: BaseGeometry, area_two: BaseGeometry) -> bool:
    """Whether two overlapping lanelets are at the same height where they overlap."""
    point = overlay.intersection(area_one, area_two).representative_point()
    heights_m = []
    for shape in (one, two):
        line = shapely.LineString(shape.center_m)
        at_m = shapely.line_locate_point(line, point)
        heights_m.append(shapely.line_interpolate_point(line, at_m).z)
    return bool(abs(np.diff(heights_m)[0]) < _SAME_LEVEL_M)
