"""Decides which roads belong to the level of a position, and which pass above or below it without a connecting path.

If the ego is on the ground, everything on the ground belongs to its level. Everything else, and for an ego on a
structure everything at all, belongs to its level if the path to it is not much longer than the straight line: at most
1.5 times as long plus 25 m. Paths run along roads in either direction, with arbitrary lane changes, and from one
carriageway of a structure across to a road beside it at nearly its height, at most 25 m away: the other carriageway, on
the same structure or on one of its own, and ramps where they leave. Of two roads above each other that would both
belong, only the one with the shorter path does, exactly where they overlap. So a bridge ahead on the ego's own road
belongs to its level and the roads below that bridge do not; a deck above the ego does not belong, and for an ego on
that deck the road below does not.

Paths are measured between blocks, which are stretches of whole carriageways, so that a level ends straight across them.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.latest_value import LatestValue
from simbev_ros.foundation.types import AnyArray, BoolArray, Float64Array, Int64Array
from simbev_ros.maps.roads.carriageways import cut_into_blocks
from simbev_ros.maps.roads.layout import Layout, Strip
from simbev_ros.maps.roads.levels import CLEARANCE_M
from simbev_ros.maps.roads.strip_pieces import StripPieces

_MAX_DETOUR_FACTOR = 1.5
_DETOUR_ALLOWANCE_M = 25.0
_REACH_M = 150.0
"""Radius around a position within which its level is determined."""

_PIECE_M = 6.0
_MAX_SIDE_DISTANCE_M = 25.0
_SURFACE_MARGIN_M = 5.0  # extent of a road's surfaces, such as the corners of junctions, beyond its lanes
_HEIGHT_WEIGHT = 3.0  # plan-view meters per meter of height in searches for the nearest road


@dataclass(frozen=True, eq=False)
class LevelMembers:
    """Members of the level of one position within 150 m; whatever is further away is not a member, or is on the ground.

    Attributes:
        piece: (N,) pieces of strips, at most about 6 m long, as indices into those of ``LevelGraph``.
        strip: (N,) id of the strip of each piece.
        level: (N,) level of each piece.
        belongs: (N,) whether the piece is on the level of the position.
        hidden: (H,) rows of pieces that belong, except for the part above or below which another piece lies ...
        hiding: (H,) ... which is the piece in this row, and belongs too.
        areas: (H,) that part in plan view, shapely, including what lies beside the piece.
    """

    piece: Int64Array
    strip: AnyArray
    level: Int64Array
    belongs: BoolArray
    hidden: Int64Array
    hiding: Int64Array
    areas: AnyArray
    _centers: cKDTree

    def holds(self, xyz_m: Float64Array) -> BoolArray:
        """(M,) whether objects at (M, 3) positions of the map frame, on a road or beside it, are on the level."""
        nearest = np.asarray(self._centers.query(_stretch_height(xyz_m))[1], np.int64)
        is_member: BoolArray = self.belongs[nearest]
        if len(self.hidden):
            point, area = shapely.STRtree(self.areas).query(shapely.points(xyz_m[:, :2]), "intersects")
            is_member[point[self.hidden[area] == nearest[point]]] = False
        return is_member


class LevelGraph:
    """The roads around all structures of a map, as a graph of short blocks.

    Attributes:
        polygons: (P,) pieces of strips in plan view, shapely.
        reaches: (P,) the same, widened by 5 m on both sides.
        level: (P,) level of each piece.
    """

    def __init__(self, layout: Layout) -> None:
        self._pieces, self._block = cut_into_blocks(_strips_near_structures(layout.strips), _PIECE_M)
        strips = self._pieces.strips
        self.polygons = self._pieces.polygons
        self.reaches = self._pieces.widen(_SURFACE_MARGIN_M).polygons
        self.level: Int64Array = np.array([strip.level for strip in strips], np.int64)[self._pieces.row]
        self._strip = np.array([strip.id for strip in strips], object)[self._pieces.row]
        self._overpass_pairs = self._pieces.overpass_pairs(CLEARANCE_M)
        count = self._block.max(initial=-1) + 1
        self._center_m = np.zeros((count, 3))
        np.add.at(self._center_m, self._block, self._pieces.center_m)
        self._center_m /= np.bincount(self._block, minlength=count)[:, None]
        first, second = np.unique(np.sort(self._block[self._links()], axis=0), axis=1)
        path_m = np.linalg.norm(self._center_m[first] - self._center_m[second], axis=1)
        self._block_graph = csr_array((path_m, (first, second)), shape=(count, count))
        self._centers = cKDTree(_stretch_height(self._pieces.center_m))
        self._blocks = cKDTree(self._center_m[:, :2])
        self._latest = LatestValue[int, LevelMembers | None]()

    def members(self, xyz_m: Float64Array) -> LevelMembers | None:
        """Members of the level of a (3,) position, map frame; None, if no structure is near: everything near belongs.

        The result is the same for all positions in a block, and the same object as long as queries stay in one block.
        """
        distance, piece = self._centers.query(_stretch_height(xyz_m))
        if distance > _REACH_M:
            return None
        block = int(self._block[piece])
        return self._latest.get(block, lambda: self._members(block))

    def _members(self, block: int) -> LevelMembers | None:
        """Members for the center of a block, see ``members``."""
        center_m = self._center_m[block]
        around = np.array(sorted(self._blocks.query_ball_point(center_m[:2], _REACH_M)), np.int64)
        local_index = np.full(len(self._center_m), -1)
        local_index[around] = np.arange(len(around))
        piece = np.flatnonzero(local_index[self._block] >= 0)
        level = self.level[piece]
        if not level.any():
            return None
        path_graph = self._block_graph[around][:, around]
        limit_m = _MAX_DETOUR_FACTOR * _REACH_M + _DETOUR_ALLOWANCE_M
        path_m = dijkstra(path_graph, directed=False, indices=int(local_index[block]), limit=limit_m)
        straight_m = np.linalg.norm(self._center_m[around] - center_m, axis=1)
        block_of_piece = local_index[self._block[piece]]
        belongs = (path_m <= _MAX_DETOUR_FACTOR * straight_m + _DETOUR_ALLOWANCE_M)[block_of_piece]
        ego_level = self.level[self._block == block].max()
        if ego_level == 0:
            belongs |= level == 0
        hidden, hiding = self._hidden_pairs(piece, belongs, path_m[block_of_piece])
        areas = overlay.intersection(self.reaches[piece[hidden]], self.polygons[piece[hiding]])
        centers = cKDTree(_stretch_height(self._pieces.center_m[piece]))
        return LevelMembers(piece, self._strip[piece], level, belongs, hidden, hiding, areas, centers)

    def _hidden_pairs(
        self, piece: Int64Array, belongs: BoolArray, path_m: Float64Array
    ) -> tuple[Int64Array, Int64Array]:
        """(H,) rows of pieces that belong, and of those above or below that belong too and have a shorter path."""
        row = np.full(len(self.level), -1)
        row[piece[belongs]] = np.flatnonzero(belongs)
        pairs = row[self._overpass_pairs]
        upper, lower = pairs[:, (pairs >= 0).all(axis=0)]
        is_longer = path_m[upper] > path_m[lower]
        return np.where(is_longer, upper, lower), np.where(is_longer, lower, upper)

    def _links(self) -> Int64Array:
        """(2, K) pairs of pieces that touch, or run side by side at structures; each pair once."""
        pieces = self._pieces
        elevated = np.flatnonzero(self.level)
        source, beside = pieces.tree.query(
            pieces.polygons[elevated], predicate="dwithin", distance=_MAX_SIDE_DISTANCE_M
        )
        source = elevated[source]
        step_m = pieces.center_m[beside] - pieces.center_m[source]
        along_m = np.abs(np.sum(step_m[:, :2] * pieces.heading[source], axis=1))
        level = (along_m <= _PIECE_M / 2.0) & (np.abs(step_m[:, 2]) < CLEARANCE_M) & (source != beside)
        source, beside = source[level], beside[level]
        parallel = pieces.parallel(source, pieces.heading[beside])
        links = np.sort(np.stack([source[parallel], beside[parallel]]), axis=0)
        return np.unique(np.concatenate([pieces.contact_pairs(np.arange(len(pieces))), links], axis=1), axis=1)


def _strips_near_structures(strips: Sequence[Strip]) -> list[Strip]:
    """Strips that may affect a position near a structure."""
    elevated = np.array([strip.level > 0 for strip in strips], bool)
    if not elevated.any():
        return []
    pieces = StripPieces.cut(strips, 4.0 * _PIECE_M)
    near = pieces.within(2.0 * _REACH_M, np.flatnonzero(elevated[pieces.row]))
    return [strips[row] for row in np.unique(pieces.row[near]).tolist()]


def _stretch_height(xyz_m: Float64Array) -> Float64Array:
    """(N, 3) positions with stretched height, so that the nearest of them is rarely above or below."""
    return np.asarray(xyz_m * np.array([1.0, 1.0, _HEIGHT_WEIGHT]), np.float64)
