"""Straightens the ends of structures: parallel lanes leave a structure at one common cross-section."""

from dataclasses import dataclass, fields

import numpy as np
import shapely
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from simbev_ros.foundation.geometry.plan_view import left_of
from simbev_ros.foundation.types import Float64Array, Int64Array
from simbev_ros.maps.roads.strip_pieces import StripPieces

_MAX_LANE_GAP_M = 2.0  # largest gap between lanes that share a deck end
_MAX_STAGGER_M = 10.0
_HEIGHT_TOLERANCE_M = 1.5
_MIN_STRETCH_M = 0.3  # minimum length of a stretch of a strip
_STATION_TOLERANCE_M = 1e-3
_TOUCH_DISTANCE_M = 0.3
_MIN_PARALLEL_COSINE = np.cos(np.radians(20.0))


@dataclass(frozen=True, slots=True)
class _Ends:
    """N positions at which a lane leaves a structure, or continues on a lower one.

    Attributes:
        position_m: (N, 3) on the center line.
        outward: (N, 2) unit vector along the road, away from the structure.
        half_width_m: (N,) half the width of the lane.
        level: (N,) the higher level.
    """

    position_m: Float64Array
    outward: Float64Array
    half_width_m: Float64Array
    level: Int64Array


def straighten_ends(pieces: StripPieces, level: Int64Array) -> tuple[StripPieces, Int64Array]:
    """Make structures end at straight cross-sections, each through the outermost of its lanes' ends.

    Returns:
        The pieces, divided at those cross-sections, and their (N,) levels.
    """
    ends = _concatenate(_ends_within_strips(pieces, level), _ends_between_strips(pieces, level))
    if len(ends.level) == 0:
        return pieces, level
    sections = _sections(ends)
    divided = pieces.divide(*_cuts(pieces, sections))
    source = np.searchsorted(_keys(pieces, pieces.start_m), _keys(divided, divided.start_m), side="right") - 1
    return divided, _raise_levels(divided, level[source], sections)


@dataclass(frozen=True, slots=True)
class _Sections:
    """N cross-sections at which structures end.

    Attributes:
        position_m: (N, 3) on the cross-section.
        outward: (N, 2) unit vector away from the structure.
        across_m: (N, 2) lateral extent of the cross-section, to the left of the position when looking outward.
        depth_m: (N,) distance inward to the innermost of the lanes' ends.
        level: (N,) level of the structure.
    """

    position_m: Float64Array
    outward: Float64Array
    across_m: Float64Array
    depth_m: Float64Array
    level: Int64Array


def _ends_within_strips(pieces: StripPieces, level: Int64Array) -> _Ends:
    """Ends where the level changes along a strip."""
    before = np.flatnonzero((pieces.row[1:] == pieces.row[:-1]) & (level[1:] != level[:-1]))
    falls = level[before] > level[before + 1]
    sign = np.where(falls, 1.0, -1.0)[:, None]
    higher = np.where(falls, before, before + 1)
    return _Ends(
        pieces.position_m(1.0)[before], sign * pieces.heading[higher], pieces.half_width_m[higher], level[higher]
    )


def _ends_between_strips(pieces: StripPieces, level: Int64Array) -> _Ends:
    """Ends where a strip ends on a structure and continues on a lower level."""
    step = np.diff(pieces.row)
    last, first = np.append(step != 0, True), np.append(True, step != 0)
    found = [
        _structure_ends(pieces, level, np.flatnonzero(at_end & (level > 0)), pieces.position_m(fraction), sign)
        for at_end, fraction, sign in ((last, 1.0, 1.0), (first, 0.0, -1.0))
    ]
    return _concatenate(*found)


def _structure_ends(
    pieces: StripPieces, level: Int64Array, piece: Int64Array, position_m: Float64Array, sign: float
) -> _Ends:
    """Select, from pieces at the ends of their strips, those that have only lower pieces ahead."""
    end, other = pieces.tree.query(pieces.polygons[piece], predicate="dwithin", distance=_TOUCH_DISTANCE_M)
    source = piece[end]
    step_m = pieces.center_m[other] - position_m[source]
    outward = sign * pieces.heading[source]
    left_m = step_m[:, 1] * outward[:, 0] - step_m[:, 0] * outward[:, 1]
    ahead = np.sum(step_m[:, :2] * outward, axis=1) > 0.0
    ahead &= (np.abs(left_m) < pieces.half_width_m[source]) & (np.abs(step_m[:, 2]) < _HEIGHT_TOLERANCE_M)
    ahead &= pieces.parallel(other, outward)
    lower = level[other] < level[source]
    leaves = np.zeros(len(piece), bool)
    leaves[end[ahead & lower]] = True
    leaves[end[ahead & ~lower]] = False
    chosen = piece[leaves]
    return _Ends(position_m[chosen], sign * pieces.heading[chosen], pieces.half_width_m[chosen], level[chosen])


def _concatenate(*parts: _Ends) -> _Ends:
    """Concatenate several sets of ends."""
    return _Ends(*(np.concatenate([getattr(fraction, field.name) for fraction in parts]) for field in fields(_Ends)))


def _sections(ends: _Ends) -> _Sections:
    """One cross-section for all ends of parallel lanes, through the outermost of them."""
    count, group = _groups(ends)
    total = np.zeros((count, 2))
    np.add.at(total, group, ends.outward)
    outward = total / np.linalg.norm(total, axis=1, keepdims=True)
    along_m = np.sum(ends.position_m[:, :2] * outward[group], axis=1)
    left_m = ends.position_m[:, 1] * outward[group, 0] - ends.position_m[:, 0] * outward[group, 1]
    order = np.lexsort([along_m, group])
    innermost = order[np.searchsorted(group[order], np.arange(count))]
    outermost = order[np.searchsorted(group[order], np.arange(count), side="right") - 1]
    across_m = np.stack([np.full(count, np.inf), np.full(count, -np.inf)], axis=1)
    np.minimum.at(across_m[:, 0], group, left_m - ends.half_width_m)
    np.maximum.at(across_m[:, 1], group, left_m + ends.half_width_m)
    return _Sections(
        position_m=ends.position_m[outermost],
        outward=outward,
        across_m=across_m - left_m[outermost, None],
        depth_m=along_m[outermost] - along_m[innermost],
        level=ends.level[outermost],
    )


def _groups(ends: _Ends) -> tuple[int, Int64Array]:
    """Number of groups, and (N,) the group of each end: ends of parallel lanes at about the same position."""
    pairs = cKDTree(ends.position_m[:, :2]).query_pairs(2.0 * _MAX_STAGGER_M, output_type="ndarray").reshape(-1, 2)
    first, second = pairs.T
    step_m = ends.position_m[second] - ends.position_m[first]
    outward = ends.outward[first]
    along_m = np.sum(step_m[:, :2] * outward, axis=1)
    left_m = step_m[:, 1] * outward[:, 0] - step_m[:, 0] * outward[:, 1]
    together = (np.sum(outward * ends.outward[second], axis=1) > _MIN_PARALLEL_COSINE) & (
        np.abs(along_m) < _MAX_STAGGER_M
    )
    together &= np.abs(left_m) < ends.half_width_m[first] + ends.half_width_m[second] + _MAX_LANE_GAP_M
    together &= (np.abs(step_m[:, 2]) < _HEIGHT_TOLERANCE_M) & (ends.level[first] == ends.level[second])
    size = len(ends.level)
    graph = coo_matrix((np.ones(together.sum()), (first[together], second[together])), shape=(size, size))
    count, group = connected_components(graph, directed=False)
    return int(count), np.asarray(group, np.int64)


def _cuts(pieces: StripPieces, sections: _Sections) -> tuple[Int64Array, Float64Array]:
    """(K,) pieces that cross-sections intersect, and (K,) stations of the intersections along their strips."""
    left = left_of(sections.outward)
    tips_m = sections.position_m[:, None, :2] + sections.across_m[:, :, None] * left[:, None]
    section, piece = pieces.tree.query(shapely.linestrings(tips_m), predicate="intersects")
    outward, position_m = sections.outward[section], sections.position_m[section]
    start_m, end_m = pieces.position_m(0.0)[piece], pieces.position_m(1.0)[piece]
    travel_m = np.sum((end_m - start_m)[:, :2] * outward, axis=1)
    fraction = np.sum((position_m - start_m)[:, :2] * outward, axis=1) / np.where(
        np.abs(travel_m) > 1e-6, travel_m, np.inf
    )
    fits = pieces.parallel(piece, outward) & (
        np.abs(pieces.center_m[piece, 2] - position_m[:, 2]) < _HEIGHT_TOLERANCE_M
    )
    station_m = pieces.start_m[piece] + fraction * (pieces.end_m[piece] - pieces.start_m[piece])
    fits &= (station_m > pieces.start_m[piece] + _STATION_TOLERANCE_M) & (
        station_m < pieces.end_m[piece] - _STATION_TOLERANCE_M
    )
    fits &= (station_m > _MIN_STRETCH_M) & (station_m < pieces.lines.length_m[pieces.row[piece]] - _MIN_STRETCH_M)
    return piece[fits], station_m[fits]


def _raise_levels(pieces: StripPieces, level: Int64Array, sections: _Sections) -> Int64Array:
    """(N,) levels, raised to the structure's between a lane's own end and its cross-section."""
    left = left_of(sections.outward)
    corners_m = [
        sections.position_m[:, :2] - inward_m * sections.outward + sections.across_m[:, [side]] * left
        for inward_m, side in ((0.0, 0), (0.0, 1), (sections.depth_m[:, None], 1), (sections.depth_m[:, None], 0))
    ]
    section, piece = pieces.tree.query(shapely.polygons(np.stack(corners_m, axis=1)))
    step_m = pieces.center_m[piece] - sections.position_m[section]
    outward = sections.outward[section]
    inward_m = -np.sum(step_m[:, :2] * outward, axis=1)
    left_m = step_m[:, 1] * outward[:, 0] - step_m[:, 0] * outward[:, 1]
    inside = (inward_m > 0.0) & (inward_m < sections.depth_m[section]) & (np.abs(step_m[:, 2]) < _HEIGHT_TOLERANCE_M)
    inside &= (left_m > sections.across_m[section, 0]) & (left_m < sections.across_m[section, 1])
    inside &= pieces.parallel(piece, outward)
    raised_level = level.copy()
    np.maximum.at(raised_level, piece[inside], sections.level[section[inside]])
    return raised_level


def _keys(pieces: StripPieces, station_m: Float64Array) -> Float64Array:
    """(N,) sort keys of stations along all strips, one strip after the other."""
    offset_m = np.concatenate([[0.0], np.cumsum(pieces.lines.length_m + 1.0)])
    return offset_m[pieces.row] + station_m
