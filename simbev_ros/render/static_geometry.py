"""The static world on the GPU: one vertex array per tile, culled per view, nearest tiles first."""

from collections.abc import Mapping, Sequence

import moderngl
import numpy as np

from simbev_ros.assets.static_scene import Tile
from simbev_ros.render.vertices import upload_mesh
from simbev_ros.render.view import View
from simbev_ros.types import BoolArray, Float64Array, UInt8Array


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

    def draw_view(self, program: str, view: View, origin_m: Float64Array) -> None:
        """Draw the tiles that a view can see, in the world of (3,) ``origin_m``."""
        low_m, high_m = np.moveaxis(self._bounds_m - origin_m, 1, 0)
        distance_m = np.linalg.norm(np.clip(view.position_m, low_m, high_m) - view.position_m, axis=1)
        self._draw(program, view.clip_from_world, origin_m, view.sees_boxes(low_m, high_m), distance_m)

    def draw_around(self, program: str, clip_from_world: Float64Array, origin_m: Float64Array, radius_m: float) -> None:
        """Draw the tiles within a horizontal distance of the origin."""
        low_m, high_m = np.moveaxis(self._bounds_m - origin_m, 1, 0)
        distance_m = np.linalg.norm(np.clip(0.0, low_m[:, :2], high_m[:, :2]), axis=1)
        self._draw(program, clip_from_world, origin_m, distance_m < radius_m, distance_m)

    def _draw(
        self,
        program: str,
        clip_from_world: Float64Array,
        origin_m: Float64Array,
        chosen: BoolArray,
        distance_m: Float64Array,
    ) -> None:
        clip_from_tile = np.tile(clip_from_world, (len(self._arrays), 1, 1))
        clip_from_tile[:, :, 3] += (self._origins_m - origin_m) @ clip_from_world[:, :3].T
        column_major = np.swapaxes(clip_from_tile, 1, 2).astype(np.float32)
        for index in np.argsort(distance_m, kind="stable"):
            if chosen[index]:
                array = self._arrays[index][program]
                array.program["clip_from_tile"].write(column_major[index].tobytes())
                array.render()
