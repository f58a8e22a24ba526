"""The static world on the GPU: one vertex array per tile, drawn in pieces, nearest tiles first.

A piece is a run of a tile's triangles, in which things that stand together are close, with a box around it. Only pieces
that may be seen are drawn, always in the same order: where two surfaces have the same depth, the first one stays.
"""

from collections.abc import Mapping, Sequence

import moderngl
import numpy as np

from simbev_ros.assets.static_scene import Tile
from simbev_ros.render.hidden import Screen, box_corners
from simbev_ros.render.vertices import upload_mesh
from simbev_ros.render.view import View, boxes_in_clip_space
from simbev_ros.types import Float64Array, Int64Array, UInt8Array

_PIECE_TRIANGLES = 256
_NEAR_M = 64.0
"""What is nearer is drawn without asking whether it is hidden, and hides the rest."""


class StaticGeometry:
    """The tiles that have something to see."""

    def __init__(
        self,
        context: moderngl.Context,
        tiles: Sequence[Tile],
        programs: Mapping[str, moderngl.Program],
        shading_class: UInt8Array,
    ) -> None:
        """Upload the tiles for use with ``programs``, each of which has a uniform mat4 ``clip_from_tile``."""
        seen = [tile for tile in tiles if len(tile.mesh.triangles)]
        self._arrays = [upload_mesh(context, tile.mesh, programs, shading_class) for tile in seen]
        self._origins_m = np.array([tile.origin_m for tile in seen], np.float64).reshape(-1, 3)
        bounds_m = np.array([tile.mesh.bounds_m for tile in seen], np.float64).reshape(-1, 2, 3)
        self._bounds_m = bounds_m + self._origins_m[:, None]
        pieces = [_pieces(tile) for tile in seen]
        self._tile = np.repeat(np.arange(len(seen)), [len(first) for first, _ in pieces])
        self._first = np.concatenate([first for first, _ in pieces])
        self._piece_bounds_m = np.concatenate([bounds for _, bounds in pieces])

    def draw_view(self, program: str, view: View, origin_m: Float64Array, target: moderngl.Framebuffer) -> None:
        """Draw into a target what a view may see in the world of (3,) ``origin_m``."""
        low_m, high_m = np.moveaxis(self._piece_bounds_m - origin_m, 1, 0)
        distance_m = self._distance_m(view.position_m + origin_m)
        pieces = self._in_order(view.sees_boxes(low_m, high_m), distance_m)
        near = distance_m[self._tile[pieces]] < _NEAR_M
        self._draw(program, view.clip_from_world, origin_m, pieces[near])
        hidden = Screen.of(target).hides(box_corners(low_m[pieces], high_m[pieces]), view.clip_from_world)
        self._draw(program, view.clip_from_world, origin_m, pieces[~near & ~hidden])
