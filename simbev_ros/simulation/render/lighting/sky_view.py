"""Map around the ego, seen from above, of how much sky the static world leaves open: streets are darker than squares.

It is computed from the heights of the static world. The visibility shader reads it; it is computed again only when the
ego leaves a coarse grid cell, and is kept for each agent.
"""

import moderngl
import numpy as np
from scipy.ndimage import grey_opening, minimum_filter

from simbev_ros.foundation.types import Float32Array, Float64Array, Int64Array
from simbev_ros.simulation.render.geometry.static_geometry import StaticGeometry
from simbev_ros.simulation.render.gl.programs import TEXTURE_UNITS
from simbev_ros.simulation.render.lighting.recent_maps import RecentMaps

_HALF_M = 192.0
_SIZE_PX = 384
_STEP_M = 32.0  # grid spacing of the map's center, which follows the ego in such steps
_DEPTH_HALF_M = 250.0
_CELL_M = 2.0 * _HALF_M / _SIZE_PX
_THIN_CELLS = 3
"""What is narrower, such as poles and walls, hides no sky."""
_GROUND_CELLS = 25
"""The ground is the lowest height within a square of this width."""
_DIRECTIONS = 16
_DISTANCES_M = (2.0, 4.0, 8.0, 14.0, 24.0, 40.0)
_MIN_RISE_M = 0.5


class SkyViewMap:
    """Texture of the open sky at every position, from ``sky_view``."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        size_px = (_SIZE_PX, _SIZE_PX)
        self._heights = context.framebuffer([context.renderbuffer(size_px, 1)], context.depth_texture(size_px))
        self._maps: RecentMaps[tuple[float, ...], moderngl.Texture] = RecentMaps(self._create_map)

    def set_agents(self, count: int) -> None:
        """Keep the maps around this number of agents; until this is called, around one."""
        self._maps.max_count = count

    def draw(self, origin_m: Float64Array, static: StaticGeometry) -> Float64Array:
        """Select the map around (3,) ``origin_m`` for shaders, and compute it unless it is there already.

        Returns:
            (4,) the vector ``sky_view_place`` of the uniform block ``Light`` (shaders/include/light.glsl).
        """
        center_m = np.round(origin_m / _STEP_M) * _STEP_M
        texture, drawn = self._maps.find(tuple(center_m))
        if drawn != tuple(center_m):
            texture.write(sky_view(self._heights_around(center_m, static), _CELL_M).astype(np.float16).tobytes())
        texture.use(TEXTURE_UNITS["sky_view"])
        offset_m = origin_m - center_m
        return np.array([*(0.5 + offset_m[:2] * (0.5 / _HALF_M)), offset_m[2], 0.5 / _HALF_M])

    def _create_map(self) -> moderngl.Texture:
        texture = self._context.texture((_SIZE_PX, _SIZE_PX), 4, dtype="f2")
        texture.repeat_x = texture.repeat_y = False
        return texture

    def _heights_around(self, center_m: Float64Array, static: StaticGeometry) -> Float64Array:
        """(S, S) heights above the center, rows along y and columns along x."""
        self._context.enable_only(moderngl.DEPTH_TEST)
        self._context.depth_func = "<"
        self._heights.use()
        self._heights.clear(depth=1.0)
        clip_from_center = np.diag([1.0 / _HALF_M, 1.0 / _HALF_M, -1.0 / _DEPTH_HALF_M, 1.0])
        static.draw_around("shadow", clip_from_center, center_m, _HALF_M * 1.5)
        depth = np.empty((_SIZE_PX, _SIZE_PX), np.float32)
        self._heights.read_into(depth, components=1, attachment=-1, dtype="f4")
        self._context.enable_only(moderngl.NOTHING)
        return (1.0 - 2.0 * depth.astype(np.float64)) * _DEPTH_HALF_M


def sky_view(height_m: Float64Array, cell_m: float) -> Float32Array:
    """Open sky at every cell of a height map, for surfaces at any height above it.

    A level surface at height z sees the share 1 / (1 + s²) of the sky's light, where s = max(top - z, 0) / width. A
    wall whose normal has the horizontal part n sees π / 2 · n · open more of it.

    Args:
        height_m: (S, S) heights, rows along y and columns along x.
        cell_m: Width of a cell.

    Returns:
        (S, S, 4) ``top`` in meters, 1 / ``width`` per meter, and ``open`` x and y: the mean of all horizontal
        directions, weighted by the share of sky above each of them.
    """
    broad_m = grey_opening(height_m, _THIN_CELLS)
    ground_m = minimum_filter(broad_m, _GROUND_CELLS)
    share, open_x, open_y, tops, weights = (np.zeros_like(height_m) for _ in range(5))
    for angle in 2.0 * np.pi * (np.arange(_DIRECTIONS) + 0.5) / _DIRECTIONS:
        direction = np.array([np.cos(angle), np.sin(angle)])
        slope, top = np.zeros_like(height_m), ground_m.copy()
        for distance_m in _DISTANCES_M:
            there_m = _shifted(broad_m, np.rint(direction * distance_m / cell_m).astype(np.int64))
            steeper = (there_m - ground_m) / distance_m > slope
            slope = np.where(steeper, (there_m - ground_m) / distance_m, slope)
            top = np.where(steeper, there_m, top)
        above = 1.0 / (1.0 + slope**2)  # of the light from this direction, for a level surface: 1 - sin²(altitude)
        share += above / _DIRECTIONS
        open_x += above * direction[0] / _DIRECTIONS
        open_y += above * direction[1] / _DIRECTIONS
        tops += slope * top
        weights += slope
    top_m = np.where(weights > 0.0, tops / np.maximum(weights, 1e-9), ground_m)
    steepness = np.sqrt(np.maximum(1.0 / share - 1.0, 0.0)) / np.maximum(top_m - ground_m, _MIN_RISE_M)
    return np.stack([top_m, steepness, open_x, open_y], axis=-1).astype(np.float32)


def _shifted(values: Float64Array, step: Int64Array) -> Float64Array:
    """(S, S) values at cells that are (x, y) steps away; those beyond the border repeat its last row or column."""
    size = len(values)
    columns, rows = (np.clip(np.arange(size) + offset, 0, size - 1) for offset in step)
    return values[rows[:, None], columns]
