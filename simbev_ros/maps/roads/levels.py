"""Assigns levels: which stretches of road are carried by structures, and how many layers lie below them.

A stretch is on a structure if the map declares it, or where it passes over another road or over water. The structure
extends along the road by the length that the slope of an abutment requires, and ends at one cross-section for all
parallel lanes. Roads at the same height that overlap (merging ramps, the inside of junctions) are on the same level.

Tunnels carry nothing: the land and the roads above them stay as they are without them. They have levels of their own,
which follow the highest of the others.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain, pairwise

import numpy as np
import shapely
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

from simbev_ros.foundation.types import BoolArray, Float64Array, Int64Array
from simbev_ros.maps.land_features import Water
from simbev_ros.maps.roads.deck_ends import straighten_ends
from simbev_ros.maps.roads.layout import Layout, Strip
from simbev_ros.maps.roads.strip_pieces import StripPieces

CLEARANCE_M = 2.5
"""Overlapping roads with a greater height difference than this pass above each other."""

_PIECE_M = 4.0
_COARSE_M = 24.0
_MIN_ABUTMENT_M = 6.0
_ABUTMENT_SLOPE = 1.5  # length per height
_MAX_LEVELS = 8
_MAX_DISTANCE_M = 3.0


def assign_levels(layout: Layout, water: Sequence[Water] = ()) -> Layout:
    """Assign levels to everything in a layout, and cut strips where their level changes.

    Args:
        layout: The layout; existing levels are ignored.
        water: Water that roads cross on bridges.
    """
    tunnels = [strip for strip in layout.strips if strip.tunnel]
    if not tunnels:
        return _assign(layout, water)
    outside = _assign(replace(layout, strips=tuple(strip for strip in layout.strips if not strip.tunnel)), water)
    inside = _assign(replace(layout, strips=tuple(tunnels)), ())
    first, pieces = outside.levels.stop, StripPieces.cut(inside.strips, _PIECE_M)
    level = first + np.array([strip.level for strip in inside.strips], np.int64)[pieces.row]

    def level_of(points_m: Float64Array, outside: int) -> int:
        """Level of a crosswalk or stop line, which is in a tunnel only if its middle is."""
        middle_m = np.mean(points_m, axis=0)
        around = pieces.tree.query(shapely.Point(middle_m[:2]), predicate="intersects")
        around = around[np.abs(pieces.center_m[around, 2] - middle_m[2]) < CLEARANCE_M]
        return int(level[around[0]]) if len(around) else outside

    return replace(
        outside,
        strips=(*outside.strips, *(_on_level(strip, first + strip.level) for strip in inside.strips)),
        crosswalks=tuple(replace(each, level=level_of(each.outline_m, each.level)) for each in outside.crosswalks),
        stop_lines=tuple(replace(each, level=level_of(each.ends_m, each.level)) for each in outside.stop_lines),
    )


def _assign(layout: Layout, water: Sequence[Water]) -> Layout:
    """Assign levels to a layout that is all outside of tunnels, or all inside."""
    level_0_strips = [_on_level(strip, 0) for strip in layout.strips]
    rows = _rows_near_structures(level_0_strips, water)
    pieces = StripPieces.cut([level_0_strips[row] for row in rows], _PIECE_M)
    level = _levels(pieces, water)
    pieces, level = straighten_ends(pieces, level)
    cut_strips: list[tuple[Strip, ...]] = [(strip,) for strip in level_0_strips]
    for row, stretches in zip(rows, _cut_by_level(pieces, level), strict=True):
        cut_strips[row] = stretches
    return replace(
        layout,
        strips=tuple(chain.from_iterable(cut_strips)),
        crosswalks=tuple(
            replace(crosswalk, level=_level_at(pieces, level, np.mean(crosswalk.outline_m, axis=0)))
            for crosswalk in layout.crosswalks
        ),
        stop_lines=tuple(
            replace(line, level=_level_at(pieces, level, np.mean(line.ends_m, axis=0))) for line in layout.stop_lines
        ),
    )


def _rows_near_structures(strips: Sequence[Strip], water: Sequence[Water]) -> list[int]:
    """Rows of the strips that may be on, above or at the end of structures; all others can be skipped."""
    pieces = StripPieces.cut(strips, _COARSE_M)
    low_m, high_m = pieces.height_range_m
    upper, lower = pieces.boxes_overlap()
    separated = high_m[upper] - low_m[lower] > CLEARANCE_M
    upper, lower = upper[separated], lower[separated]
    over_water, above_water_m = _over_water(pieces, water)
    rise_m = np.concatenate([[0.0], high_m[upper] - low_m[lower], above_water_m])
    on_structure = np.concatenate([upper, lower, over_water, np.flatnonzero(_is_declared(pieces))])
    reach_m = float(_abutment_m(rise_m).max()) + _COARSE_M
    return np.unique(pieces.row[pieces.within(reach_m, on_structure)]).tolist()


def _is_declared(pieces: StripPieces) -> BoolArray:
    """(N,) whether the map declares that a piece is on a structure."""
    return np.array([strip.structure for strip in pieces.strips], bool)[pieces.row]


def _levels(pieces: StripPieces, water: Sequence[Water]) -> Int64Array:
    """(N,) level of each piece."""
    declared = _is_declared(pieces)
    upper, lower = pieces.overpass_pairs(CLEARANCE_M)
    heights_m = pieces.center_m[:, 2]
    rise_m = heights_m[upper] - heights_m[lower]
    over_water, above_water_m = _over_water(pieces, water)
    level = np.zeros(len(pieces), np.int64)
    if not (len(upper) or len(over_water) or declared.any()):
        return level
    reach_m = np.zeros(len(pieces))
    np.maximum.at(reach_m, np.concatenate([upper, over_water]), _abutment_m(np.concatenate([rise_m, above_water_m])))
    links = _links(pieces, np.concatenate([upper, over_water, np.flatnonzero(declared)]), float(reach_m.max()))
    sources = declared.copy()
    sources[over_water] = True
    for number in range(1, _MAX_LEVELS + 1):
        sources[upper[level[lower] >= number - 1]] = True
        if not sources.any():
            break
        on_structure, source = _extend_structures(links, np.where(sources, reach_m, -1.0))
        # A ramp that descends below its own structure is not carried by it there.
        below = lower[on_structure[upper]]
        on_structure[below[heights_m[source[below]] - heights_m[below] > CLEARANCE_M]] = False
        level[on_structure] = number
        sources[:] = False
    return level


def _abutment_m(rise_m: Float64Array) -> Float64Array:
    """Distance by which a structure extends beyond the object below it, given its height above that object."""
    return np.maximum(_MIN_ABUTMENT_M, _ABUTMENT_SLOPE * rise_m) + _PIECE_M / 2.0


def _over_water(pieces: StripPieces, water: Sequence[Water]) -> tuple[Int64Array, Float64Array]:
    """(K,) pieces that cross water and their (K,) height above it."""
    number, piece = pieces.tree.query(np.array([each.area for each in water], object), predicate="intersects")
    surface_m = np.array([each.surface_m for each in water], np.float64)
    above_m = pieces.center_m[piece, 2] - surface_m[number]
    return piece[above_m > 0.0], above_m[above_m > 0.0]


def _links(pieces: StripPieces, sources: Int64Array, reach_m: float) -> coo_matrix:
    """(N, N) path lengths between touching pieces, around the pieces from which structures extend."""
    first, second = pieces.contact_pairs(pieces.within(reach_m, sources))
    return coo_matrix((pieces.path_lengths_m(first, second), (first, second)), shape=(len(pieces), len(pieces)))


def _extend_structures(links: coo_matrix, reach_m: Float64Array) -> tuple[BoolArray, Int64Array]:
    """(N,) whether a piece is within reach of a source along the road, and (N,) that source, or the piece itself.

    Args:
        links: (N, N) path lengths between neighbors.
        reach_m: (N,) distance by which structures extend from each piece; negative: the piece is not a source.
    """
    count, longest_m = len(reach_m), float(reach_m.max())
    sources = np.flatnonzero(reach_m >= 0.0)
    # Add a root node; its distance to each source is the longest reach minus that source's reach.
    weight_m = np.concatenate([links.data, longest_m - reach_m[sources]]) + 1e-6
    rows = np.concatenate([links.row, np.full(len(sources), count)])
    columns = np.concatenate([links.col, sources])
    graph = coo_matrix((weight_m, (rows, columns)), shape=(count + 1, count + 1)).tocsr()
    _, before = dijkstra(graph, directed=False, indices=count, limit=longest_m + 1e-3, return_predecessors=True)
    reached: BoolArray = before[:count] >= 0
    source = np.where(reached & (before[:count] < count), before[:count], np.arange(count))
    while (source[source] != source).any():
        source = source[source]
    return reached, source.astype(np.int64)


def _cut_by_level(pieces: StripPieces, level: Int64Array) -> Iterator[tuple[Strip, ...]]:
    """For each strip its stretches of constant level."""
    changes = (np.diff(pieces.row, prepend=-1) != 0) | (np.diff(level, prepend=-1) != 0)
    starts = np.flatnonzero(changes)
    ends = np.append(starts[1:], len(pieces)) - 1
    bounds = np.searchsorted(pieces.row[starts], np.arange(len(pieces.strips) + 1)).tolist()
    for strip, (first, last) in zip(pieces.strips, pairwise(bounds), strict=True):
        if last - first == 1:
            yield (_on_level(strip, int(level[starts[first]])),)
        else:
            spans = range(first, last)
            yield tuple(_stretch(pieces, int(starts[span]), int(ends[span]), level, span - first) for span in spans)


def _on_level(strip: Strip, level: int) -> Strip:
    """The strip with this level."""
    return strip if strip.level == level else replace(strip, level=level)


def _stretch(pieces: StripPieces, start: int, end: int, level: Int64Array, number: int) -> Strip:
    """The part of a strip from one of its pieces to another."""
    row = int(pieces.row[start])
    strip, start_m, end_m = pieces.strips[row], pieces.start_m[start], pieces.end_m[end]
    first, second = pieces.lines.parameter(np.array([row, row]), np.array([start_m, end_m])) - pieces.lines.first[row]
    indices = np.concatenate([[first], np.arange(np.floor(first) + 1.0, np.ceil(second)), [second]])
    points = np.arange(len(strip.left_m))

    def resampled(side: Float64Array) -> Float64Array:
        return np.stack([np.interp(indices, points, axis) for axis in side.T], axis=1)

    return replace(
        strip,
        id=f"{strip.id}@{number}",
        left_m=resampled(strip.left_m),
        right_m=resampled(strip.right_m),
        raised_m=None if strip.raised_m is None else resampled(strip.raised_m),
        s_start_m=strip.s_start_m + float(start_m),
        level=int(level[start]),
    )


def _level_at(pieces: StripPieces, level: Int64Array, position_m: Float64Array) -> int:
    """Level of the piece nearest to a (3,) position, in plan view and height; 0 away from roads."""
    point = shapely.Point(position_m[:2])
    near = pieces.tree.query(point, predicate="dwithin", distance=_MAX_DISTANCE_M)
    if len(near) == 0:
        return 0
    gap_m = shapely.distance(pieces.polygons[near], point) + np.abs(pieces.center_m[near, 2] - position_m[2])
    return int(level[near[np.argmin(gap_m)]])
