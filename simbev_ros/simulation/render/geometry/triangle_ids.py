"""Geometry pass for GPUs: draws triangle indices, from which a compute shader fills the G-buffer.

A visibility buffer (Burns, Hunt 2013): rasterization does as little as possible, because data center GPUs have few
cores for it, and a pixel that is overdrawn later costs only eight bytes.
"""

import moderngl

from simbev_ros.foundation.types import BoolArray, Float64Array
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.simulation.render.geometry.actor_geometry import ActorGeometry
from simbev_ros.simulation.render.geometry.rigid_table import RigidTable
from simbev_ros.simulation.render.geometry.static_geometry import StaticGeometry
from simbev_ros.simulation.render.gl.programs import TEXTURE_UNITS, ProgramLibrary
from simbev_ros.simulation.render.gl.targets import Targets
from simbev_ros.simulation.render.view import View


class TriangleIds:
    """The pass, for static and actor geometry whose programs named ``id`` draw triangle indices."""

    def __init__(self, context: moderngl.Context, library: ProgramLibrary) -> None:
        self._context = context
        self._resolve = library.screen_pass("resolve.frag")
        self._origins = context.buffer(reserve=12, dynamic=True)
        self._targets: dict[tuple[int, int], moderngl.Framebuffer] = {}

    def draw(
        self,
        targets: Targets,
        view: View,
        origin_m: Float64Array,
        static: StaticGeometry,
        actors: ActorGeometry,
        world: WorldState,
        table: RigidTable,
        visible: BoolArray,
    ) -> None:
        """Fill the G-buffer with what a view sees of the static world and of the (N,) ``visible`` actors."""
        target = self._target_for(targets.geometry.size)
        target.use()
        self._context.enable_only(moderngl.DEPTH_TEST)
        self._context.front_face = "cw"  # image rows run downward, which mirrors every triangle
        self._context.depth_func = "<"
        target.clear()
        static.draw_view("id", view, origin_m, read_occluders=None)
        self._context.enable(moderngl.CULL_FACE)  # actors are closed
        actors.draw("id", world, table, visible, view.pixel_m(table.center_m, table.radius_m))
        self._context.enable_only(moderngl.NOTHING)
        self._bind(target, static, actors, origin_m)
        self._resolve.draw(targets.geometry)

    def _bind(
        self, target: moderngl.Framebuffer, static: StaticGeometry, actors: ActorGeometry, origin_m: Float64Array
    ) -> None:
        """Bind the buffers and textures that ``resolve.frag`` reads."""
        ids, depth = target.color_attachments[0], target.depth_attachment
        assert isinstance(ids, moderngl.Texture) and isinstance(depth, moderngl.Texture)
        ids.use(TEXTURE_UNITS["triangle_ids"])
        depth.use(TEXTURE_UNITS["triangle_depth"])
        static.store.bind(vertices=0, triangles=1)
        actors.store.bind(vertices=3, triangles=4)
        origins = static.origins_m(origin_m).tobytes()
        self._origins.orphan(max(len(origins), 12))
        self._origins.write(origins)
        self._origins.bind_to_storage_buffer(2)

    def _target_for(self, size_px: tuple[int, int]) -> moderngl.Framebuffer:
        if size_px not in self._targets:
            ids = self._context.texture(size_px, 2, dtype="u4")
            depth = self._context.depth_texture(size_px)
            depth.compare_func = ""
            for texture in (ids, depth):
                texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
            self._targets[size_px] = self._context.framebuffer([ids], depth)
        return self._targets[size_px]
