"""Straight ends of structures: the lanes that lie side by side leave a structure at one cross-section."""

from dataclasses import dataclass, fields

import numpy as np
import shapely
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from simbev_ros.maps.roads.strip_pieces import StripPieces
from simbev_ros.types import Float64Array, Int64Array

_SIDE_BY_SIDE_M = 2.0  # largest gap between lanes that share a deck end
_STAGGER_M = 10.0
_SAME_HEIGHT_M = 1.5
_SHORTEST_M = 0.3  # of a stretch of a strip
_GRAIN_M = 1e-3
_TOUCHING_M = 0.3
_PARALLEL = np.cos(np.radians(20.0))


@dataclass(frozen=True, slots=True)
class _Ends:
    """Where a lane leaves a structure, or passes to a lower one: N places.

    Attributes:
        place_m: (N, 3) on the center line.
        outward: (N, 2) unit vector down from the structure along the road.
        half_width_m: (N,) of the lane.
        level: (N,) the higher one.
    """

    place_m: Float64Array
    outward: Float64Array
    half_width_m: Float64Array
    level: Int64Array


def straight_cuts(pieces: StripPieces, level: Int64Array) -> tuple[StripPieces, Int64Array]:
    """Let structures end at straight cross-sections: no further in than any of their lanes' ends.

    Returns:
        The pieces, divided at those cross-sections, and their (N,) levels.
    """
    ends = _joined(_ends_within_strips(pieces, level), _ends_between_strips(pieces, level))
    if len(ends.level) == 0:
        return pieces, level
    sections = _sections(ends)
    divided = pieces.divided(*_cuts(pieces, sections))
    source = np.searchsorted(_keys(pieces, pieces.start_m), _keys(divided, divided.start_m), side="right") - 1
    return divided, _raised(divided, level[source], sections)


@dataclass(frozen=True, slots=True)
class _Sections:
    """Cross-sections at which structures end: N of them.

    Attributes:
        place_m: (N, 3) on the cross-section.
        outward: (N, 2) unit vector away from the structure.
        across_m: (N, 2) from where to where it goes, to the left of the place when looking outward.
        depth_m: (N,) how far inward the lanes' own ends reach.
        level: (N,) of the structure.
    """

    place_m: Float64Array
    outward: Float64Array
    across_m: Float64Array
    depth_m: Float64Array
    level: Int64Array


def _ends_within_strips(pieces: StripPieces, level: Int64Array) -> _Ends:
    """Where the level changes along a strip."""
    before = np.flatnonzero((pieces.row[1:] == pieces.row[:-1]) & (level[1:] != level[:-1]))
    falls = level[before] > level[before + 1]
    sign = np.where(falls, 1.0, -1.0)[:, None]
    higher = np.where(falls, before, before + 1)
    return _Ends(pieces.place_m(1.0)[before], sign * pieces.heading[higher], pieces.half_width_m[higher], level[higher])


def _ends_between_strips(pieces: StripPieces, level: Int64Array) -> _Ends:
    """Where a strip ends on a structure, and what lies ahead of it is lower."""
    step = np.diff(pieces.row)
    last, first = np.append(step != 0, True), np.append(True, step != 0)
    found = [
        _leaving(pieces, level, np.flatnonzero(at_end & (level > 0)), pieces.place_m(part), sign)
        for at_end, part, sign in ((last, 1.0, 1.0), (first, 0.0, -1.0))
    ]
    return _joined(*found)


def _leaving(pieces: StripPieces, level: Int64Array, piece: Int64Array, place_m: Float64Array, sign: float) -> _Ends:
    """Those of some pieces, at the ends of their strips, that have something lower and nothing else ahead."""
    end, other = pieces.tree.query(pieces.polygons[piece], predicate="dwithin", distance=_TOUCHING_M)
    here = piece[end]
    step_m = pieces.center_m[other] - place_m[here]
    outward = sign * pieces.heading[here]
    left_m = step_m[:, 1] * outward[:, 0] - step_m[:, 0] * outward[:, 1]
    ahead = np.sum(step_m[:, :2] * outward, axis=1) > 0.0
    ahead &= (np.abs(left_m) < pieces.half_width_m[here]) & (np.abs(step_m[:, 2]) < _SAME_HEIGHT_M)
    ahead &= pieces.parallel(other, outward)
    lower = level[other] < level[here]
    leaves = np.zeros(len(piece), bool)
    leaves[end[ahead & lower]] = True
    leaves[end[ahead & ~lower]] = False
    chosen = piece[leaves]
    return _Ends(place_m[chosen], sign * pieces.heading[chosen], pieces.half_width_m[chosen], level[chosen])


def _joined(*parts: _Ends) -> _Ends:
    """All of them."""
    return _Ends(*(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(_Ends)))


def _sections(ends: _Ends) -> _Sections:
    """One cross-section for all ends of lanes that lie side by side, through the outermost of them."""
    count, group = _groups(ends)
    total = np.zeros((count, 2))
    np.add.at(total, group, ends.outward)
    outward = total / np.linalg.norm(total, axis=1, keepdims=True)
    along_m = np.sum(ends.place_m[:, :2] * outward[group], axis=1)
    left_m = ends.place_m[:, 1] * outward[group, 0] - ends.place_m[:, 0] * outward[group, 1]
    order = np.lexsort([along_m, group])
    innermost = order[np.searchsorted(group[order], np.arange(count))]
    outermost = order[np.searchsorted(group[order], np.arange(count), side="right") - 1]
    across_m = np.stack([np.full(count, np.inf), np.full(count, -np.inf)], axis=1)
    np.minimum.at(across_m[:, 0], group, left_m - ends.half_width_m)
    np.maximum.at(across_m[:, 1], group, left_m + ends.half_width_m)
    return _Sections(
        place_m=ends.place_m[outermost],
        outward=outward,
        across_m=across_m - left_m[outermost, None],
        depth_m=along_m[outermost] - along_m[innermost],
        level=ends.level[outermost],
    )


def _groups(ends: _Ends) -> tuple[int, Int64Array]:
    """How many groups there are, and the (N,) group of each end: lanes side by side, at about the same place."""
    pairs = cKDTree(ends.place_m[:, :2]).query_pairs(2.0 * _STAGGER_M, output_type="ndarray").reshape(-1, 2)
    first, second = pairs.T
    step_m = ends.place_m[second] - ends.place_m[first]
    outward = ends.outward[first]
    along_m = np.sum(step_m[:, :2] * outward, axis=1)
    left_m = step_m[:, 1] * outward[:, 0] - step_m[:, 0] * outward[:, 1]
    together = (np.sum(outward * ends.outward[second], axis=1) > _PARALLEL) & (np.abs(along_m) < _STAGGER_M)
    together &= np.abs(left_m) < ends.half_width_m[first] + ends.half_width_m[second] + _SIDE_BY_SIDE_M
    together &= (np.abs(step_m[:, 2]) < _SAME_HEIGHT_M) & (ends.level[first] == ends.level[second])
    size = len(ends.level)
    graph = coo_matrix((np.ones(together.sum()), (first[together], second[together])), shape=(size, size))
    count, group = connected_components(graph, directed=False)
    return int(count), np.asarray(group, np.int64)


def _cuts(pieces: StripPieces, sections: _Sections) -> tuple[Int64Array, Float64Array]:
    """(K,) pieces that cross-sections go through, and where along their strips."""
    left = np.column_stack([-sections.outward[:, 1], sections.outward[:, 0]])
    tips_m = sections.place_m[:, None, :2] + sections.across_m[:, :, None] * left[:, None]
    section, piece = pieces.tree.query(shapely.linestrings(tips_m), predicate="intersects")
    outward, place_m = sections.outward[section], sections.place_m[section]
    start_m, end_m = pieces.place_m(0.0)[piece], pieces.place_m(1.0)[piece]
    travel_m = np.sum((end_m - start_m)[:, :2] * outward, axis=1)
    part = np.sum((place_m - start_m)[:, :2] * outward, axis=1) / np.where(np.abs(travel_m) > 1e-6, travel_m, np.inf)
    fits = pieces.parallel(piece, outward) & (np.abs(pieces.center_m[piece, 2] - place_m[:, 2]) < _SAME_HEIGHT_M)
    at_m = pieces.start_m[piece] + part * (pieces.end_m[piece] - pieces.start_m[piece])
    fits &= (at_m > pieces.start_m[piece] + _GRAIN_M) & (at_m < pieces.end_m[piece] - _GRAIN_M)
    fits &= (at_m > _SHORTEST_M) & (at_m < pieces.lines.length_m[pieces.row[piece]] - _SHORTEST_M)
    return piece[fits], at_m[fits]


def _raised(pieces: StripPieces, level: Int64Array, sections: _Sections) -> Int64Array:
    """(N,) levels, where all between a lane's own end and its cross-section is on the structure too."""
    left = np.column_stack([-sections.outward[:, 1], sections.outward[:, 0]])
    corners_m = [
        sections.place_m[:, :2] - inward_m * sections.outward + sections.across_m[:, [side]] * left
        for inward_m, side in ((0.0, 0), (0.0, 1), (sections.depth_m[:, None], 1), (sections.depth_m[:, None], 0))
    ]
    section, piece = pieces.tree.query(shapely.polygons(np.stack(corners_m, axis=1)))
    step_m = pieces.center_m[piece] - sections.place_m[section]
    outward = sections.outward[section]
    inward_m = -np.sum(step_m[:, :2] * outward, axis=1)
    left_m = step_m[:, 1] * outward[:, 0] - step_m[:, 0] * outward[:, 1]
    inside = (inward_m > 0.0) & (inward_m < sections.depth_m[section]) & (np.abs(step_m[:, 2]) < _SAME_HEIGHT_M)
    inside &= (left_m > sections.across_m[section, 0]) & (left_m < sections.across_m[section, 1])
    inside &= pieces.parallel(piece, outward)
    raised = level.copy()
    np.maximum.at(raised, piece[inside], sections.level[section[inside]])
    return raised


def _keys(pieces: StripPieces, at_m: Float64Array) -> Float64Array:
    """(N,) numbers in the order of places along all strips, one after the other."""
    offset_m = np.concatenate([[0.0], np.cumsum(pieces.lines.length_m + 1.0)])
    return offset_m[pieces.row] + at_m
