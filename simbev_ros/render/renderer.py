"""The renderer: from the world's meshes and state to a camera's exact images, one geometry pass per camera."""

from collections.abc import Sequence

import moderngl

from simbev_ros.assets.actor_model import ActorModel
from simbev_ros.assets.static_scene import StaticScene
from simbev_ros.render.actor_geometry import ActorGeometry, visible_actors
from simbev_ros.render.context import open_context
from simbev_ros.render.frame import CameraImages, CameraView, RenderFrame
from simbev_ros.render.programs import BLOCK_BINDINGS, ProgramLibrary, draw_screen
from simbev_ros.render.rigid_table import RigidTable, RigidTextures
from simbev_ros.render.static_geometry import StaticGeometry
from simbev_ros.render.targets import Targets, read_image
from simbev_ros.render.view import View


class Renderer:
    """Draws a static scene and its actors. Not for use from several threads."""

    def __init__(
        self, static: StaticScene, models: Sequence[ActorModel], context: moderngl.Context | None = None
    ) -> None:
        """Upload everything.

        Args:
            static: The immobile world.
            models: The catalogue, indexed by blueprint.
            context: A context of ``open_context``; by default a new one.

        Raises:
            RenderError: OpenGL is not usable here.
        """
        self._context = open_context() if context is None else context
        self._models = models
        with self._context:
            import numpy as np
            shading_class = np.ones(256, np.uint8)
            library = ProgramLibrary(self._context)
            self._static = StaticGeometry(
                self._context, static.tiles, {"geometry": library.load("static_geometry.vert", "geometry.frag")}, shading_class
            )
            self._actors = ActorGeometry(
                self._context, models, {"geometry": library.load("actor_geometry.vert", "geometry.frag")}, shading_class
            )
            self._background = library.screen_pass("background.frag")
            self._labels = library.screen_pass("labels.frag")
            self._flow = library.screen_pass("flow.frag")
            self._rigid = RigidTextures(self._context)
            self._view_block = self._context.buffer(reserve=224)
            self._view_block.bind_to_uniform_block(BLOCK_BINDINGS["View"])
            self._targets: dict[tuple[int, int], Targets] = {}

    def render(self, cameras: Sequence[CameraView], frame: RenderFrame) -> list[CameraImages]:
        """Images of the ego's cameras at one moment, in the order of ``cameras``.

        Raises:
            RenderError: The world has too many actors, or ids above 65535.
        """
        ego = frame.world.ego
        import numpy as np
        origin_m = np.array([ego["x"], ego["y"], ego["z"]])
        with self._context:
            table = RigidTable.of(self._models, frame.world, frame.previous, origin_m)
            self._rigid.upload(table)
            return [self._render_camera(camera, frame, table, origin_m) for camera in cameras]

    def _render_camera(self, camera, frame, table, origin_m) -> CameraImages:
        view = View.of(camera, frame.world, frame.previous, origin_m)
        size_px = (camera.camera.width_px, camera.camera.height_px)
        if size_px not in self._targets:
            self._targets[size_px] = Targets(self._context, size_px)
        targets = self._targets[size_px]
        self._view_block.write(view.block())
        self._draw_geometry(targets, view, frame, table, origin_m)
        targets.bind()
        targets.labels.use()
        draw_screen(self._labels)
        targets.flow.use()
        draw_screen(self._flow)
        return CameraImages(None, read_image(targets.labels), read_image(targets.labels, 1), read_image(targets.geometry, 1), read_image(targets.flow))

    def _draw_geometry(self, targets, view, frame, table, origin_m) -> None:
        targets.geometry.use()
        targets.geometry.clear()
        self._context.enable_only(moderngl.DEPTH_TEST)
        self._context.front_face = "cw"
        self._context.depth_func = "<"
        self._static.draw_view("geometry", view, origin_m)
        self._actors.draw("geometry", frame.world, table, visible_actors(frame.world, view, origin_m, frame.show_ego))
        self._context.depth_func = "<="
        draw_screen(self._background)
        self._context.enable_only(moderngl.NOTHING)
