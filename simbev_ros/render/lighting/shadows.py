"""Shadow map of the sun or moon around the ego, shared by all cameras of a frame: two squares in one texture.

The static part depends only on the light's direction and on a coarse grid cell around the ego, so it is kept until one
of them changes: the picture is the same whether it was kept or drawn anew. Actors are added every frame.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import moderngl
import numpy as np

from simbev_ros.config.rendering import QUALITIES, Quality
from simbev_ros.render.geometry.actor_geometry import ActorGeometry
from simbev_ros.render.geometry.rigid_table import RigidTable
from simbev_ros.render.geometry.static_geometry import StaticGeometry
from simbev_ros.render.gl.programs import TEXTURE_UNITS
from simbev_ros.render.view import View
from simbev_ros.scene.state import WorldState
from simbev_ros.types import Float64Array

_SIZES_PX = (1024, 2048, 2048)  # of a square, by quality
_DEPTH_HALF_M = 400.0
_BLUR_M = 1.0
"""Shadows are looked up less than this away from the surface that they fall on."""


@dataclass(frozen=True, slots=True)
class Cascade:
    """One square of the map.

    Attributes:
        half_m: Half its width.
        step_m: Its middle follows the ego in such steps.
    """

    half_m: float
    step_m: float


CASCADES = (Cascade(36.0, 6.0), Cascade(150.0, 24.0))
"""Side by side in the texture."""


class ShadowMap:
    """The depth of the static world as the light sees it, and the same with actors added."""

    def __init__(self, context: moderngl.Context, quality: Quality) -> None:
        self._context = context
        self._square_px = _SIZES_PX[QUALITIES.index(quality)]
        size_px = (self._square_px * len(CASCADES), self._square_px)
        # moderngl copies depth only along with a colour attachment, so there is one, unused.
        unused = context.renderbuffer(size_px, 1)
        depth = context.depth_texture(size_px)
        depth.compare_func = "<="
        depth.filter = (moderngl.LINEAR, moderngl.LINEAR)
        depth.use(TEXTURE_UNITS["shadow_map"])
        self._static = context.framebuffer([unused], context.depth_texture(size_px))
        self._all = context.framebuffer([unused], depth)
        self._drawn: list[tuple[float, ...]] = [() for _ in CASCADES]

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
        """Draw the map for light from (3,) ``direction``, without actors whose shadow falls out of all views.

        Returns:
            Per cascade a (4, 4) projection of world points to its clip space.
        """
        self._context.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        self._context.front_face = "ccw"
        self._context.depth_func = "<"
        centers_m = [np.round(origin_m / cascade.step_m) * cascade.step_m for cascade in CASCADES]
        clip_from_center = [_clip_from_center(direction, cascade.half_m) for cascade in CASCADES]
        for index, cascade in enumerate(CASCADES):
            drawn = (*centers_m[index], *direction)
            if self._drawn[index] != drawn:
                self._begin(self._static, index)
                self._static.clear(depth=1.0, viewport=self._static.viewport)
                reach_m = cascade.half_m + _DEPTH_HALF_M / 2.0
                static.draw_around("shadow", clip_from_center[index], centers_m[index], reach_m)
                self._drawn[index] = drawn
        self._all.scissor = (0, 0, *self._all.size)  # it clips the copy
        self._all.use()
        self._context.copy_framebuffer(self._all, self._static)
        clip_from_world = []
        blurred_m = table.radius_m + _BLUR_M
        seen = np.any([view.sees_shadows(table.center_m, blurred_m, direction) for view in views], axis=0)
        for index, cascade in enumerate(CASCADES):
            clip = clip_from_center[index].copy()
            clip[:, 3] += clip[:, :3] @ (origin_m - centers_m[index])
            self._begin(self._all, index)
            across = table.center_m @ clip[:2, :3].T + clip[:2, 3]
            within = np.all(np.abs(across) < 1.0 + table.radius_m[:, None] / cascade.half_m, axis=1)
            pixel_m = np.full(len(seen), 2.0 * cascade.half_m / self._square_px)
            actors.draw("shadow", world, table, seen & within, pixel_m, clip_from_shadow=clip)
            clip_from_world.append(clip)
        return clip_from_world

    def _begin(self, framebuffer: moderngl.Framebuffer, index: int) -> None:
        """Draw into one cascade's square."""
        framebuffer.use()
        square = (index * self._square_px, 0, self._square_px, self._square_px)
        framebuffer.viewport = framebuffer.scissor = square


def _clip_from_center(direction: Float64Array, half_m: float) -> Float64Array:
    """(4, 4) parallel projection along the light, of points relative to the map's centre."""
    side = np.cross([0.0, 0.0, 1.0], direction)
    side = np.array([1.0, 0.0, 0.0]) if np.linalg.norm(side) < 1e-6 else side / np.linalg.norm(side)
    clip = np.eye(4)
    clip[0, :3] = side / half_m
    clip[1, :3] = np.cross(direction, side) / half_m
    clip[2, :3] = -direction / _DEPTH_HALF_M
    return clip
