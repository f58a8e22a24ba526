"""Which roads are on the level of a place, and which pass above or beneath it without a way from one to the other.

Where the ego is on the ground, all that is on the ground belongs to its level. All else, and for an ego on a structure
everything, belongs to its level if the way there is hardly longer than the straight line: at most 1.5 times as long and
25 m. Ways run along the roads, driven either way, lanes changed at will, and from one carriageway of a structure across
to what runs beside it at nearly its height, at most 25 m away: the other carriageway, on the same structure or on one
of its own, and ramps where they leave. Of two roads above each other that would both belong, only the one with the
shorter way does, exactly where they overlap. So a bridge ahead on the ego's own road belongs and what it covers does
not; a deck above the ego does not, and for an ego on that deck the road beneath does not.

Ways are measured between blocks, stretches of whole carriageways, so that what belongs ends straight across them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import shapely
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from simbev_ros.maps.roads.carriageways import blocks_of
from simbev_ros.maps.roads.layout import Layout, Strip
from simbev_ros.maps.roads.levels import CLEARANCE_M
from simbev_ros.maps.roads.strip_pieces import StripPieces
from simbev_ros.types import AnyArray, BoolArray, Float64Array, Int64Array

_DETOUR = 1.5
_ALLOWANCE_M = 25.0
REACH_M = 150.0
"""So far around a place its level is looked for."""

_PIECE_M = 6.0
_BESIDE_M = 25.0
_BEYOND_M = 5.0  # surfaces that belong to a road, such as the corners of junctions, reach so far beyond its lanes
_HEIGHT_WEIGHT = 3.0  # meters in plan that a meter of height counts for, when the nearest road is looked for


class RoadsByLevel(NamedTuple):
    """Ids of the strips around a place; one that is on several sides of its level in part counts for the first."""

    own: tuple[str, ...]
    above: tuple[str, ...]
    below: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class LevelMembers:
    """What belongs to the level of one place, within 150 m of it; what is further away does not, or is on the ground.

    Attributes:
        piece: (N,) pieces of strips, at most about 6 m long, as indices into ``LevelGraph``'s.
        strip: (N,) id of the strip that each is of.
        level: (N,) of the piece.
        belongs: (N,) whether it is on the level of the place.
        above: (N,) whether it does not because it passes above; what neither belongs nor is above passes beneath.
        hidden: (H,) rows of pieces that belong, but for the part above or beneath which lies the piece ...
        hiding: (H,) ... of this row, which belongs too.
        areas: (H,) that part in plan, shapely, with what lies beside the piece.
    """

    piece: Int64Array
    strip: AnyArray
    level: Int64Array
    belongs: BoolArray
    above: BoolArray
    hidden: Int64Array
    hiding: Int64Array
    areas: AnyArray
    _centers: cKDTree

    def holds(self, xyz_m: Float64Array) -> BoolArray:
        """(M,) whether what stands at (M, 3) places of the map frame, on a road or beside it, is on the level."""
        nearest = np.asarray(self._centers.query(_weighted(xyz_m))[1], np.int64)
        held: BoolArray = self.belongs[nearest]
        if len(self.hidden):
            place, area = shapely.STRtree(self.areas).query(shapely.points(xyz_m[:, :2]), "intersects")
            held[place[self.hidden[area] == nearest[place]]] = False
        return held

    @property
    def roads(self) -> RoadsByLevel:
        """The strips of the pieces, in order."""
        own, above = (set(self.strip[chosen].tolist()) for chosen in (self.belongs, self.above))
        names = dict.fromkeys(self.strip.tolist())
        return RoadsByLevel(
            tuple(name for name in names if name in own),
            tuple(name for name in names if name in above - own),
            tuple(name for name in names if name not in above | own),
        )


class LevelGraph:
    """The roads around all structures of a map, as a graph of short blocks.

    Attributes:
        polygons: (P,) pieces of strips in plan, shapely.
        reaches: (P,) the same with what lies beside them, 5 m to both sides.
        level: (P,) of each piece.
    """

    def __init__(self, layout: Layout) -> None:
        self._pieces, self._block = blocks_of(_near_structures(layout.strips), _PIECE_M)
        strips = self._pieces.strips
        self.polygons = self._pieces.polygons
        self.reaches = self._pieces.widened(_BEYOND_M).polygons
        self.level: Int64Array = np.array([strip.level for strip in strips], np.int64)[self._pieces.row]
        self._strip = np.array([strip.id for strip in strips], object)[self._pieces.row]
        self._stacked = self._pieces.stacked(CLEARANCE_M)
        count = self._block.max(initial=-1) + 1
        self._center_m = np.zeros((count, 3))
        np.add.at(self._center_m, self._block, self._pieces.center_m)
        self._center_m /= np.bincount(self._block, minlength=count)[:, None]
        first, second = np.unique(np.sort(self._block[self._links()], axis=0), axis=1)
        way_m = np.linalg.norm(self._center_m[first] - self._center_m[second], axis=1)
        self._ways = csr_array((way_m, (first, second)), shape=(count, count))
        self._centers = cKDTree(_weighted(self._pieces.center_m))
        self._blocks = cKDTree(self._center_m[:, :2])
        self._latest: tuple[int, LevelMembers | None] | None = None

    def members(self, xyz_m: Float64Array) -> LevelMembers | None:
        """What belongs to the level of a (3,) place, map frame; None: everything near, for no structure is.

        The answer is the same all over a block, and the same object as long as the place stays in it.
        """
        distance, piece = self._centers.query(_weighted(xyz_m))
        if distance > REACH_M:
            return None
        block = int(self._block[piece])
        if self._latest is None or self._latest[0] != block:
            self._latest = block, self._members(block)
        return self._latest[1]

    def _members(self, block: int) -> LevelMembers | None:
        """As ``members``, for the middle of a block."""
        center_m = self._center_m[block]
        around = np.array(sorted(self._blocks.query_ball_point(center_m[:2], REACH_M)), np.int64)
        number = np.full(len(self._center_m), -1)
        number[around] = np.arange(len(around))
        piece = np.flatnonzero(number[self._block] >= 0)
        level = self.level[piece]
        if not level.any():
            return None
        ways_m = self._ways[around][:, around]
        limit_m = _DETOUR * REACH_M + _ALLOWANCE_M
        way_m = dijkstra(ways_m, directed=False, indices=int(number[block]), limit=limit_m)
        straight_m = np.linalg.norm(self._center_m[around] - center_m, axis=1)
        block_of_piece = number[self._block[piece]]
        belongs = (way_m <= _DETOUR * straight_m + _ALLOWANCE_M)[block_of_piece]
        here = self.level[self._block == block].max()
        if here == 0:
            belongs |= level == 0
        higher = self._pieces.center_m[piece, 2] > center_m[2]
        above = ~belongs & ((level > here) | ((level == here) & higher))
        hidden, hiding = self._hidden(piece, belongs, way_m[block_of_piece])
        areas = shapely.intersection(self.reaches[piece[hidden]], self.polygons[piece[hiding]])
        centers = cKDTree(_weighted(self._pieces.center_m[piece]))
        return LevelMembers(piece, self._strip[piece], level, belongs, above, hidden, hiding, areas, centers)

    def _hidden(self, piece: Int64Array, belongs: BoolArray, way_m: Float64Array) -> tuple[Int64Array, Int64Array]:
        """(H,) rows of pieces that belong, and of those above or beneath them which do and have a shorter way."""
        row = np.full(len(self.level), -1)
        row[piece[belongs]] = np.flatnonzero(belongs)
        pairs = row[self._stacked]
        upper, lower = pairs[:, (pairs >= 0).all(axis=0)]
        farther = way_m[upper] > way_m[lower]
        return np.where(farther, upper, lower), np.where(farther, lower, upper)

    def _links(self) -> Int64Array:
        """(2, K) pairs of pieces that touch, or where structures are, run side by side; each once."""
        pieces = self._pieces
        carried = np.flatnonzero(self.level)
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
    near = pieces.within(2.0 * REACH_M, np.flatnonzero(carried[pieces.row]))
    return [strips[row] for row in np.unique(pieces.row[near]).tolist()]


def _weighted(xyz_m: Float64Array) -> Float64Array:
    """(N, 3) places with their height stretched, so that the nearest of them is rarely above or beneath."""
    return np.asarray(xyz_m * np.array([1.0, 1.0, _HEIGHT_WEIGHT]), np.float64)
