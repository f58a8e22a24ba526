"""Which roads are on the level of a place, and which pass above or beneath it without a way from one to the other.

Where the ego is on the ground, all that is on the ground belongs to its level. All else, and for an ego on a structure
everything, belongs to its level if the way there is hardly longer than the straight line: at most 1.5 times as long and
25 m. Ways run along the roads, driven either way, lanes changed at will, and from one carriageway of a structure across
to what runs beside it at nearly its height, at most 25 m away: the other carriageway, on the same structure or on one
of its own, and ramps where they leave. Of two roads above each other that would both belong, only the one with the
shorter way does, where they overlap. So a bridge ahead on the ego's own road belongs and what passes beneath it does
not; a deck above the ego does not, and for an ego on that deck the road beneath does not.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from simbev_ros.maps.roads.layout import Layout, Strip
from simbev_ros.maps.roads.levels import CLEARANCE_M
from simbev_ros.maps.roads.strip_pieces import StripPieces
from simbev_ros.types import AnyArray, BoolArray, Float64Array, Int64Array

_DETOUR = 1.5
_ALLOWANCE_M = 25.0
_REACH_M = 150.0
_PIECE_M = 6.0
_BESIDE_M = 25.0
_HEIGHT_WEIGHT = 3.0  # metres in plan that a metre of height counts for, when the nearest road is looked for


@dataclass(frozen=True)
class LevelMembers:
    """What belongs to the level of one place, within 150 m of it; what is further away does not, or is on the ground.

    Attributes:
        polygons: (N,) pieces of strips in plan, about 6 m long, shapely.
        strip: (N,) id of the strip that each is of.
        level: (N,) of the piece.
        belongs: (N,) whether it is on the level of the place.
        piece: (N,) index of each in ``LevelGraph.polygons``.
    """

    polygons: AnyArray
    strip: AnyArray
    level: Int64Array
    belongs: BoolArray
    piece: Int64Array
    _centers: cKDTree

    def holds(self, xyz_m: Float64Array) -> BoolArray:
        """(M,) whether what stands at (M, 3) places of the map frame, on a road or beside it, is on the level."""
        _, piece = self._centers.query(_weighted(xyz_m))
        return np.asarray(self.belongs[piece], np.bool_)


class LevelGraph:
    """The roads around all structures of a map, as a graph of short pieces."""

    def __init__(self, layout: Layout) -> None:
        self._pieces = StripPieces.of(_near_structures(layout.strips), _PIECE_M)
        strips = self._pieces.strips
        self._strip = np.array([strip.id for strip in strips], object)[self._pieces.row]
        self._level = np.array([strip.level for strip in strips], np.int64)[self._pieces.row]
        first, second = self._links()
        way_m = np.linalg.norm(self._pieces.center_m[first] - self._pieces.center_m[second], axis=1)
        self._ways = csr_array((way_m, (first, second)), shape=(len(self._level), len(self._level)))
        self._centers = cKDTree(self._pieces.center_m[:, :2])
        self._stacked = self._pieces.stacked(CLEARANCE_M)

    @property
    def polygons(self) -> AnyArray:
        """(P,) all pieces in plan, shapely."""
        return self._pieces.polygons

    def members(self, xyz_m: Float64Array) -> LevelMembers | None:
        """What belongs to the level of a (3,) place, map frame; None: everything near, for no structure is."""
        around = np.array(sorted(self._centers.query_ball_point(xyz_m[:2], _REACH_M)), np.int64)
        if not self._level[around].any():
            return None
        center_m, level = self._pieces.center_m[around], self._level[around]
        centers = cKDTree(_weighted(center_m))
        here = int(centers.query(_weighted(xyz_m[None]))[1][0])
        straight_m = np.linalg.norm(center_m - center_m[here], axis=1)
        way_m = dijkstra(
            self._ways[around][:, around], directed=False, indices=here, limit=_DETOUR * _REACH_M + _ALLOWANCE_M
        )
        belongs = way_m <= _DETOUR * straight_m + _ALLOWANCE_M
        if level[here] == 0:
            belongs |= level == 0
        upper, lower = self._stacked_among(around, belongs)
        belongs[np.where(way_m[upper] > way_m[lower], upper, lower)] = False
        return LevelMembers(self.polygons[around], self._strip[around], level, belongs, around, centers)

    def _stacked_among(self, around: Int64Array, belongs: BoolArray) -> Int64Array:
        """(2, K) pairs of rows of ``around``, the first above the second, that both belong."""
        row = np.full(len(self._level), -1)
        row[around[belongs]] = np.flatnonzero(belongs)
        pairs = row[self._stacked]
        return np.asarray(pairs[:, (pairs >= 0).all(axis=0)], np.int64)

    def _links(self) -> Int64Array:
        """(2, K) pairs of pieces that touch, or where structures are, run side by side; each once."""
        pieces = self._pieces
        carried = np.flatnonzero(self._level)
        source, beside = pieces.tree.query(pieces.polygons[carried], predicate="dwithin", distance=_BESIDE_M)
        source = carried[source]
        step_m = pieces.center_m[beside] - pieces.center_m[source]
        along_m = np.abs(np.sum(step_m[:, :2] * pieces.heading[source], axis=1))
        level = (along_m <= _PIECE_M / 2.0) & (np.abs(step_m[:, 2]) < CLEARANCE_M) & (source != beside)
        source, beside = source[level], beside[level]
        parallel = pieces.parallel(source, pieces.heading[beside])
        links = np.sort(np.stack([source[parallel], beside[parallel]]), axis=0)
        return np.unique(np.concatenate([pieces.contacts(np.arange(len(pieces))), links], axis=1), axis=1)


def _near_structures(strips: Sequence[Strip]) -> list[Strip]:
    """Those that may matter to a place near a structure."""
    carried = np.array([strip.level > 0 for strip in strips], bool)
    if not carried.any():
        return []
    pieces = StripPieces.of(strips, 4.0 * _PIECE_M)
    near = pieces.within(2.0 * _REACH_M, np.flatnonzero(carried[pieces.row]))
    return [strips[row] for row in np.unique(pieces.row[near]).tolist()]


def _weighted(xyz_m: Float64Array) -> Float64Array:
    """(N, 3) places with their height stretched, so that the nearest of them is rarely above or beneath."""
    return np.asarray(xyz_m * np.array([1.0, 1.0, _HEIGHT_WEIGHT]), np.float64)
