"""The static world on the GPU: all tiles in one triangle store, drawn in pieces, nearest tiles first.

A piece is a run of a tile's triangles with a bounding box. The set of drawn pieces depends on the view, but their order
never does: of two surfaces at the same depth, the first one stays.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import moderngl
import numpy as np

from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.placement.static_scene import Tile
from simbev_ros.foundation.types import Float32Array, Float64Array, Int64Array
from simbev_ros.simulation.render.geometry.occlusion import ReadOccluders
from simbev_ros.simulation.render.geometry.triangle_store import TriangleStore
from simbev_ros.simulation.render.view import View, boxes_in_clip_space

_INSTANCE_DTYPE = np.dtype([("in_place", "<f4", 3), ("in_tile", "<u4"), ("in_first", "<u4")])
_PIECE_TRIANGLES = 256

_COARSE_ERROR_M = 0.12
_COARSE_FROM_M = 350.0
"""Minimum distance of coarse stand-ins: there their depth error is below 0.1 %.

Their outline error must also be below a pixel.
"""

_PLAIN, _DETAIL, _COARSE = range(3)
"""Grades of pieces: always drawn, only drawn nearby, and only drawn far away."""

_STAGES_M = (32.0, 96.0, 160.0, 256.0, 512.0, np.inf)
"""Tiles are drawn in stages by distance. What is drawn already hides much of what is further away."""

_MIN_CULLED_TRIANGLES = 16_000
"""Minimum number of waiting triangles for an occlusion test, which takes as long as drawing that many."""


class _Pieces(NamedTuple):
    """Pieces of a tile: (K,) first triangles and ends, (K,) grades, and (K, 2, 3) bounds in the map frame."""

    first: Int64Array
    end: Int64Array
    grade: Int64Array
    bounds_m: Float64Array


_NONE = np.zeros(0, np.int64)
_NO_PIECES = _Pieces(_NONE, _NONE, _NONE, np.zeros((0, 2, 3)))


class StaticGeometry:
    """Uploaded tiles of the static world, and the draw calls for their visible pieces."""

    def __init__(
        self,
        context: moderngl.Context,
        tiles: Sequence[Tile],
        programs: Mapping[str, moderngl.Program],
    ) -> None:
        """Upload the tiles for use with ``programs``; their instances have the position and the index of a tile."""
        nonempty = [tile for tile in tiles if len(tile.mesh.triangles)]
        meshes = [Mesh.merge([tile.mesh, tile.coarse]) for tile in nonempty]
        self.store = TriangleStore(context, meshes, programs, _INSTANCE_DTYPE)
        self._origins_m = np.array([tile.origin_m for tile in nonempty], np.float64).reshape(-1, 3)
        self._tile_bounds_m = np.array([tile.mesh.bounds_m + tile.origin_m for tile in nonempty]).reshape(-1, 2, 3)
        pieces = [_pieces(tile, mesh) for tile, mesh in zip(nonempty, meshes, strict=True)]
        self._tile = np.repeat(np.arange(len(nonempty)), [len(piece.first) for piece in pieces])
        columns = zip(_NO_PIECES, *pieces, strict=True)
        self._first, self._end, self._grade, self._bounds_m = (np.concatenate(column) for column in columns)
        starts = np.cumsum([0, *(len(mesh.triangles) for mesh in meshes)])[self._tile]
        self._first, self._end = self._first + starts, self._end + starts

    def draw_view(self, program: str, view: View, origin_m: Float64Array, read_occluders: ReadOccluders | None) -> None:
        """Draw what a view sees, in a world of origin (3,) ``origin_m``; occluders are updated between the stages."""
        low_m, high_m = np.moveaxis(self._bounds_m - origin_m, 1, 0)
        distance_m = _distance_m(view.position_m, self._tile_bounds_m - origin_m)
        skipped_grade = np.where(
            distance_m < max(_COARSE_ERROR_M * view.camera.fx_px, _COARSE_FROM_M), _COARSE, _DETAIL
        )
        visible = view.sees_boxes(low_m, high_m)
        waiting = np.flatnonzero(visible & (self._grade != skipped_grade[self._tile]))
        triangles = self._end - self._first
        for end_m in _STAGES_M if read_occluders else _STAGES_M[-1:]:
            if read_occluders and end_m > _STAGES_M[0] and triangles[waiting].sum() > _MIN_CULLED_TRIANGLES:
                waiting = waiting[~read_occluders().hidden(view, low_m[waiting], high_m[waiting])]
            in_stage = distance_m[self._tile[waiting]] < end_m
            self._draw(program, origin_m, waiting[in_stage], distance_m)
            waiting = waiting[~in_stage]

    def draw_around(self, program: str, clip_from_world: Float64Array, origin_m: Float64Array, radius_m: float) -> None:
        """Draw what a projection shows of the tiles within a horizontal distance of the origin.

        The (4, 4) projection becomes the program's uniform ``clip_from_shadow``.
        """
        low_m, high_m = np.moveaxis(self._bounds_m - origin_m, 1, 0)
        distance_m = _distance_m(np.zeros(2), (self._tile_bounds_m - origin_m)[..., :2])
        visible = boxes_in_clip_space(clip_from_world, low_m, high_m) & (distance_m[self._tile] < radius_m)
        visible &= self._grade != _COARSE
        self.store.program(program)["clip_from_shadow"] = tuple(clip_from_world.T.ravel())
        self._draw(program, origin_m, np.flatnonzero(visible), distance_m)

    def _draw(self, program: str, origin_m: Float64Array, pieces: Int64Array, distance_m: Float64Array) -> None:
        """Draw pieces, given in ascending order, tile after tile by the tiles' (T,) distances."""
        pieces = pieces[np.argsort(distance_m[self._tile[pieces]], kind="stable")]
        tiles = self._tile[pieces]
        begins = (np.diff(pieces, prepend=-2) != 1) | (np.diff(tiles, prepend=-1) != 0)
        instances = np.empty(begins.sum(), _INSTANCE_DTYPE)
        instances["in_tile"] = tiles[begins]
        instances["in_place"] = self.origins_m(origin_m)[tiles[begins]]
        counts = np.ones(len(instances), np.int64)
        self.store.draw(program, self._first[pieces[begins]], self._end[pieces[np.roll(begins, -1)]], counts, instances)

    def origins_m(self, origin_m: Float64Array) -> Float32Array:
        """(T, 3) the tiles' origins in a world of origin (3,) ``origin_m``."""
        return (self._origins_m - origin_m).astype(np.float32)


def _pieces(tile: Tile, mesh: Mesh) -> _Pieces:
    """Pieces of a tile; its mesh and coarse stand-ins are concatenated in ``mesh``."""
    plain = len(tile.mesh.triangles) - tile.detail
    ends = np.array([plain, plain + tile.detail, len(mesh.triangles)])
    first_of_grade = [np.arange(first, end, _PIECE_TRIANGLES) for first, end in zip((0, *ends[:-1]), ends, strict=True)]
    grade = np.repeat(np.arange(len(first_of_grade)), [len(first) for first in first_of_grade])
    first = np.concatenate(first_of_grade)
    end = np.minimum(first + _PIECE_TRIANGLES, ends[grade])
    corners = mesh.vertices[mesh.triangles.ravel()]
    low_m, high_m = (extreme.reduceat(corners, 3 * first) for extreme in (np.minimum, np.maximum))
    return _Pieces(first, end, grade, np.stack([low_m, high_m], axis=1) + tile.origin_m)


def _distance_m(position_m: Float64Array, bounds_m: Float64Array) -> Float64Array:
    """(N,) distance of a position from (N, 2, D) boxes."""
    return np.linalg.norm(np.clip(position_m, bounds_m[:, 0], bounds_m[:, 1]) - position_m, axis=1)
