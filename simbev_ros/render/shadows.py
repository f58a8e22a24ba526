"""Shadow maps of the sun or moon around the ego, shared by all cameras of a frame.

The map of the static world depends only on the light's direction and on a coarse grid cell around the ego, so it is kept
until one of them changes: the picture is the same whether it was kept or drawn anew. Actors are added every frame.
"""

from dataclasses import dataclass

import moderngl
import numpy as np

from simbev_ros.render.actor_geometry import ActorGeometry
from simbev_ros.render.programs import TEXTURE_UNITS
from simbev_ros.render.rigid_table import RigidTable
from simbev_ros.render.static_geometry import StaticGeometry
from simbev_ros.scene.state import WorldState
from simbev_ros.types import Float64Array

_SIZE_PX = 2048
_DEPTH_HALF_M = 400.0
_TEXTURE_FROM_CLIP = np.array(
    [[0.5, 0.0, 0.0, 0.5], [0.0, 0.5, 0.0, 0.5], [0.0, 0.0, 0.5, 0.5], [0.0, 0.0, 0.0, 1.0]]
)


@dataclass(frozen=True, slots=True)
class Cascade:
    """Extent of one map: a square of ``half_m`` around a point that moves in steps of ``step_m``."""

    name: str
    half_m: float
    step_m: float


CASCADES = (Cascade("shadow_near", 36.0, 6.0), Cascade("shadow_far", 150.0, 24.0))


class ShadowMap:
    """One cascade: the static world's depth, and the same with actors added."""

    def __init__(self, context: moderngl.Context, cascade: Cascade) -> None:
        self._context, self._cascade = context, cascade
        self._static = context.framebuffer(depth_attachment=context.depth_texture((_SIZE_PX, _SIZE_PX)))
        depth = context.depth_texture((_SIZE_PX, _SIZE_PX))
        depth.compare_func = "<="
        depth.filter = (moderngl.LINEAR, moderngl.LINEAR)
        depth.repeat_x = depth.repeat_y = False
        depth.use(TEXTURE_UNITS[cascade.name])
        self._all = context.framebuffer(depth_attachment=depth)
        self._drawn: tuple[float, ...] = ()

    def draw(
        self,
        direction: Float64Array,
        origin_m: Float64Array,
        static: StaticGeometry,
        actors: ActorGeometry,
        world: WorldState,
        table: RigidTable,
    ) -> Float64Array:
        """Draw the map for light from (3,) ``direction``.

        Returns:
            (4, 4) texture coordinates and depth from world points.
        """
        center_m = np.round(origin_m / self._cascade.step_m) * self._cascade.step_m
        clip_from_center = _clip_from_center(direction, self._cascade.half_m)
        self._context.enable_only(moderngl.DEPTH_TEST)
        self._context.depth_func = "<"
        if self._drawn != (drawn := (*center_m, *direction)):
            self._static.use()
            self._static.clear(depth=1.0)
            static.draw_around("shadow", clip_from_center, center_m, self._cascade.half_m + _DEPTH_HALF_M / 2.0)
            self._drawn = drawn
        self._context.copy_framebuffer(self._all, self._static)
        self._all.use()
        clip_from_world = clip_from_center.copy()
        clip_from_world[:, 3] += clip_from_center[:, :3] @ (origin_m - center_m)
        near = np.hypot(world.actors["x"] - center_m[0], world.actors["y"] - center_m[1]) < self._cascade.half_m * 2.0
        actors.draw("shadow", world, table, near, clip_from_shadow=clip_from_world)
        return _TEXTURE_FROM_CLIP @ clip_from_world


def _clip_from_center(direction: Float64Array, half_m: float) -> Float64Array:
    """(4, 4) parallel projection along the light, of points relative to the map's centre."""
    side = np.cross([0.0, 0.0, 1.0], direction)
    side = np.array([1.0, 0.0, 0.0]) if np.linalg.norm(side) < 1e-6 else side / np.linalg.norm(side)
    clip = np.eye(4)
    clip[0, :3] = side / half_m
    clip[1, :3] = np.cross(direction, side) / half_m
    clip[2, :3] = -direction / _DEPTH_HALF_M
    return clip
