"""Shadow map of the sun or moon around the ego, shared by all cameras of a frame: two squares in one texture.

The static part depends only on the light's direction and on a coarse grid cell around the ego, so it is cached until
one of them changes, for each of several agents; the image is the same whether it was cached or redrawn. Actors are
added every frame.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import moderngl
import numpy as np

from simbev_ros.config.rendering import QUALITIES, Quality
from simbev_ros.foundation.types import Float64Array
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.simulation.render.geometry.actor_geometry import ActorGeometry
from simbev_ros.simulation.render.geometry.rigid_table import RigidTable
from simbev_ros.simulation.render.geometry.static_geometry import StaticGeometry
from simbev_ros.simulation.render.gl.programs import TEXTURE_UNITS
from simbev_ros.simulation.render.lighting.recent_maps import RecentMaps
from simbev_ros.simulation.render.view import View

_SIZES_PX = (1024, 2048, 2048)  # size of a square, by quality
_DEPTH_HALF_M = 400.0
_BLUR_M = 1.0
"""Shadows are looked up within this distance of the surface that they fall on."""


@dataclass(frozen=True, slots=True)
class Cascade:
    """One square of the map.

    Attributes:
        half_m: Half its width.
        step_m: Grid spacing of its center, which follows the ego in such steps.
    """

    half_m: float
    step_m: float


CASCADES = (Cascade(36.0, 6.0), Cascade(150.0, 24.0))
"""From near to far; side by side in the texture."""


_Key = tuple[tuple[float, ...], ...]
"""Center and light direction of each cascade."""


class ShadowMap:
    """Depth of the static world as the light sees it, and a copy with actors added."""

    def __init__(self, context: moderngl.Context, quality: Quality) -> None:
        self._context = context
        self._square_px = _SIZES_PX[QUALITIES.index(quality)]
        size_px = (self._square_px * len(CASCADES), self._square_px)
        # moderngl copies depth only together with a color attachment, so there is an unused one.
        self._unused = context.renderbuffer(size_px, 1)
        depth = context.depth_texture(size_px)
        depth.compare_func = "<="
        depth.filter = (moderngl.LINEAR, moderngl.LINEAR)
        depth.use(TEXTURE_UNITS["shadow_map"])
        self._all = context.framebuffer([self._unused], depth)
        self._static_maps: RecentMaps[_Key, moderngl.Framebuffer] = RecentMaps(self._create_static_map)

    def set_agents(self, count: int) -> None:
        """Cache the static part around this number of agents; until this is called, around one."""
        self._static_maps.max_count = count

    def draw(
        self,
        direction: Float64Array,
        origin_m: Float64Array,
        static: StaticGeometry,
        actors: ActorGeometry,
        world: WorldState,
        table: RigidTable,
        views: Sequence[View],
    ) -> list[Float64Array]:
        """Draw the map for light from (3,) ``direction``, without actors with shadows outside all views.

        Returns:
            Per cascade a (4, 4) projection of world points to its clip space.
        """
        centers_m = [np.round(origin_m / cascade.step_m) * cascade.step_m for cascade in CASCADES]
        keys = tuple((*center_m, *direction) for center_m in centers_m)
        static_map, drawn_keys = self._static_maps.find(keys)
        self._context.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        self._context.front_face = "ccw"
        self._context.depth_func = "<"
        clip_from_center = [_clip_from_center(direction, cascade.half_m) for cascade in CASCADES]
        for index, cascade in enumerate(CASCADES):
            if drawn_keys is None or drawn_keys[index] != keys[index]:
                self._use_square(static_map, index)
                static_map.clear(depth=1.0, viewport=static_map.viewport)
                reach_m = cascade.half_m + _DEPTH_HALF_M / 2.0
                static.draw_around("shadow", clip_from_center[index], centers_m[index], reach_m)
        self._all.scissor = (0, 0, *self._all.size)  # the scissor also clips the copy
        self._all.use()
        self._context.copy_framebuffer(self._all, static_map)
        clip_from_world = []
        blurred_m = table.radius_m + _BLUR_M
        visible = np.any([view.sees_shadows(table.center_m, blurred_m, direction) for view in views], axis=0)
        for index, cascade in enumerate(CASCADES):
            clip = clip_from_center[index].copy()
            clip[:, 3] += clip[:, :3] @ (origin_m - centers_m[index])
            self._use_square(self._all, index)
            offset = table.center_m @ clip[:2, :3].T + clip[:2, 3]
            inside = np.all(np.abs(offset) < 1.0 + table.radius_m[:, None] / cascade.half_m, axis=1)
            pixel_m = np.full(len(visible), 2.0 * cascade.half_m / self._square_px)
            actors.draw("shadow", world, table, visible & inside, pixel_m, clip_from_shadow=clip)
            clip_from_world.append(clip)
        return clip_from_world

    def _create_static_map(self) -> moderngl.Framebuffer:
        return self._context.framebuffer([self._unused], self._context.depth_texture(self._all.size))

    def _use_square(self, framebuffer: moderngl.Framebuffer, index: int) -> None:
        """Direct drawing into one cascade's square."""
        framebuffer.use()
        square = (index * self._square_px, 0, self._square_px, self._square_px)
        framebuffer.viewport = framebuffer.scissor = square


def _clip_from_center(direction: Float64Array, half_m: float) -> Float64Array:
    """(4, 4) parallel projection along the light, of points relative to the map's center."""
    side = np.cross([0.0, 0.0, 1.0], direction)
    side = np.array([1.0, 0.0, 0.0]) if np.linalg.norm(side) < 1e-6 else side / np.linalg.norm(side)
    clip = np.eye(4)
    clip[0, :3] = side / half_m
    clip[1, :3] = np.cross(direction, side) / half_m
    clip[2, :3] = -direction / _DEPTH_HALF_M
    return clip
