"""The static world on the GPU: all tiles in one store, drawn in pieces, nearest tiles first.

A piece is a run of a tile's triangles with a box around it. Which pieces are drawn depends on what may be seen, but
never their order: of two surfaces at the same depth the first one stays.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import moderngl
import numpy as np

from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.placement.static_scene import Tile
from simbev_ros.render.geometry.occlusion import Look
from simbev_ros.render.geometry.triangle_store import TriangleStore
from simbev_ros.render.view import View, boxes_in_clip_space
from simbev_ros.types import Float32Array, Float64Array, Int64Array

_INSTANCE_DTYPE = np.dtype([("in_place", "<f4", 3), ("in_tile", "<u4"), ("in_first", "<u4")])
_PIECE_TRIANGLES = 256

_COARSE_ERROR_M = 0.12
_COARSE_FROM_M = 350.0
"""Stand-ins are drawn from here on, where their depth errs by less than 0.1 %, if their outlines' error is less than a
pixel."""

_PLAIN, _DETAIL, _COARSE = range(3)
"""Grades of pieces: drawn always, nearby only, and far away only."""

_STAGES_M = (32.0, 96.0, 160.0, 256.0, 512.0, np.inf)
"""Tiles are drawn in stages by their distance. What is drawn already hides much of what is farther."""

_WORTH_A_LOOK = 16_000
"""Triangles. Asking what hides them takes as long as drawing so many."""


class _Pieces(NamedTuple):
    """(K,) first triangles and ends of pieces of a tile, (K,) their grades, and (K, 2, 3) their boxes in the map."""

    first: Int64Array
    end: Int64Array
    grade: Int64Array
    bounds_m: Float64Array


_NONE = np.zeros(0, np.int64)
_NO_PIECES = _Pieces(_NONE, _NONE, _NONE, np.zeros((0, 2, 3)))


class StaticGeometry:
    """The tiles that have something to see."""

    def __init__(
        self,
        context: moderngl.Context,
        tiles: Sequence[Tile],
        programs: Mapping[str, moderngl.Program],
    ) -> None:
        """Upload the tiles for use with ``programs``, whose instances have the place and the number of a tile."""
        seen = [tile for tile in tiles if len(tile.mesh.triangles)]
        meshes = [Mesh.merged([tile.mesh, tile.coarse]) for tile in seen]
        self.store = TriangleStore(context, meshes, programs, _INSTANCE_DTYPE)
        self._origins_m = np.array([tile.origin_m for tile in seen], np.float64).reshape(-1, 3)
        self._tile_bounds_m = np.array([tile.mesh.bounds_m + tile.origin_m for tile in seen]).reshape(-1, 2, 3)
        pieces = [_pieces(tile, mesh) for tile, mesh in zip(seen, meshes, strict=True)]
        self._tile = np.repeat(np.arange(len(seen)), [len(piece.first) for piece in pieces])
        columns = zip(_NO_PIECES, *pieces, strict=True)
        self._first, self._end, self._grade, self._bounds_m = (np.concatenate(column) for column in columns)
        starts = np.cumsum([0, *(len(mesh.triangles) for mesh in meshes)])[self._tile]
        self._first, self._end = self._first + starts, self._end + starts

    def draw_view(self, program: str, view: View, origin_m: Float64Array, look: Look | None) -> None:
        """Draw what a view sees of the world of (3,) ``origin_m``, without what ``look`` finds hidden meanwhile."""
        low_m, high_m = np.moveaxis(self._bounds_m - origin_m, 1, 0)
        distance_m = _distance_m(view.position_m, self._tile_bounds_m - origin_m)
        left_out = np.where(distance_m < max(_COARSE_ERROR_M * view.camera.fx_px, _COARSE_FROM_M), _COARSE, _DETAIL)
        seen = view.sees_boxes(low_m, high_m)
        waiting = np.flatnonzero(seen & (self._grade != left_out[self._tile]))
        triangles = self._end - self._first
        for end_m in _STAGES_M if look else _STAGES_M[-1:]:
            if look and end_m > _STAGES_M[0] and triangles[waiting].sum() > _WORTH_A_LOOK:
                waiting = waiting[~look().hide(view, low_m[waiting], high_m[waiting])]
            now = distance_m[self._tile[waiting]] < end_m
            self._draw(program, origin_m, waiting[now], distance_m)
            waiting = waiting[~now]

    def draw_around(self, program: str, clip_from_world: Float64Array, origin_m: Float64Array, radius_m: float) -> None:
        """Draw what a projection shows of the tiles within a horizontal distance of the origin.

        The (4, 4) projection becomes the program's uniform ``clip_from_shadow``.
        """
        low_m, high_m = np.moveaxis(self._bounds_m - origin_m, 1, 0)
        distance_m = _distance_m(np.zeros(2), (self._tile_bounds_m - origin_m)[..., :2])
        shown = boxes_in_clip_space(clip_from_world, low_m, high_m) & (distance_m[self._tile] < radius_m)
        shown &= self._grade != _COARSE
        self.store.program(program)["clip_from_shadow"] = tuple(clip_from_world.T.ravel())
        self._draw(program, origin_m, np.flatnonzero(shown), distance_m)

    def _draw(self, program: str, origin_m: Float64Array, pieces: Int64Array, distance_m: Float64Array) -> None:
        """Draw pieces, given in ascending order, tile after tile by the tiles' (T,) distances."""
        pieces = pieces[np.argsort(distance_m[self._tile[pieces]], kind="stable")]
        tiles = self._tile[pieces]
        begins = (np.diff(pieces, prepend=-2) != 1) | (np.diff(tiles, prepend=-1) != 0)
        instances = np.empty(begins.sum(), _INSTANCE_DTYPE)
        instances["in_tile"] = tiles[begins]
        instances["in_place"] = self.places_m(origin_m)[tiles[begins]]
        counts = np.ones(len(instances), np.int64)
        self.store.draw(program, self._first[pieces[begins]], self._end[pieces[np.roll(begins, -1)]], counts, instances)

    def places_m(self, origin_m: Float64Array) -> Float32Array:
        """(T, 3) the tiles' origins in the world of (3,) ``origin_m``."""
        return (self._origins_m - origin_m).astype(np.float32)


def _pieces(tile: Tile, mesh: Mesh) -> _Pieces:
    """Those of a tile, whose mesh and stand-ins are one mesh."""
    plain = len(tile.mesh.triangles) - tile.detail
    ends = np.array([plain, plain + tile.detail, len(mesh.triangles)])
    runs = [np.arange(first, end, _PIECE_TRIANGLES) for first, end in zip((0, *ends[:-1]), ends, strict=True)]
    grade = np.repeat(np.arange(len(runs)), [len(run) for run in runs])
    first = np.concatenate(runs)
    end = np.minimum(first + _PIECE_TRIANGLES, ends[grade])
    corners = mesh.vertices[mesh.triangles]
    low_m = np.minimum.reduceat(corners.min(axis=1), first)
    high_m = np.maximum.reduceat(corners.max(axis=1), first)
    return _Pieces(first, end, grade, np.stack([low_m, high_m], axis=1) + tile.origin_m)


def _distance_m(place_m: Float64Array, bounds_m: Float64Array) -> Float64Array:
    """(N,) distance of a place from (N, 2, D) boxes."""
    distance_m: Float64Array = np.linalg.norm(np.clip(place_m, bounds_m[:, 0], bounds_m[:, 1]) - place_m, axis=1)
    return distance_m
