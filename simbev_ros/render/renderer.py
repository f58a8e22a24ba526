"""The renderer: from the world's meshes and state to a camera's exact images, one geometry pass per camera."""

from collections.abc import Sequence

import moderngl
import numpy as np

from simbev_ros.assets.actor_model import ActorModel
from simbev_ros.assets.static_scene import StaticScene
from simbev_ros.config.rendering import QUALITIES, Quality
from simbev_ros.config.rig import Modality
from simbev_ros.geometry.camera import PinholeCamera
from simbev_ros.render.actor_geometry import ActorGeometry, visible_actors
from simbev_ros.render.contact import HALF_M, ContactMap
from simbev_ros.render.context import open_context
from simbev_ros.render.frame import CameraImages, CameraView, RenderFrame
from simbev_ros.render.hidden import Occluders
from simbev_ros.render.lamp_field import LampField
from simbev_ros.render.light import SkyLight
from simbev_ros.render.noise import noise_texture
from simbev_ros.render.programs import BLOCK_BINDINGS, VISIBILITY_STEPS, ProgramLibrary, draw_screen
from simbev_ros.render.rigid_table import RigidTable, RigidTextures
from simbev_ros.render.shading import Shading
from simbev_ros.render.shadows import ShadowMap
from simbev_ros.render.static_geometry import StaticGeometry
from simbev_ros.render.surfaces import shading_class_of_material
from simbev_ros.render.targets import Targets, read_image
from simbev_ros.render.view import VIEW_BLOCK_BYTES, View
from simbev_ros.scene.lights import LightSpec
from simbev_ros.types import Float64Array


class Renderer:
    """Draws a static scene and its actors. To be used by one thread."""

    def __init__(
        self,
        static: StaticScene,
        models: Sequence[ActorModel],
        context: moderngl.Context | None = None,
        quality: Quality = "medium",
    ) -> None:
        """Upload everything.

        Args:
            static: The immobile world.
            models: The catalogue, indexed by blueprint.
            context: From ``open_context``; by default a new one.
            quality: Of the colour image.

        Raises:
            RenderError: OpenGL is not usable here.
        """
        self._context = open_context() if context is None else context
        self._models = models
        self._targets: dict[tuple[int, int], Targets] = {}
        with self._context:
            library = ProgramLibrary(self._context, quality)
            self._visibility_step = VISIBILITY_STEPS[QUALITIES.index(quality)]
            self._static, self._actors = self._upload(static, library)
            self._background = library.screen_pass("background.frag")
            self._shading = Shading(self._context, library)
            self._shadow_map = ShadowMap(self._context)
            self._lamp_field = LampField(self._context, library, static.street_lights)
            self._contact_map = ContactMap(self._context, library)
            self._noise = noise_texture(self._context)
            self._rigid = RigidTextures(self._context)
            self._view_block = self._context.buffer(reserve=VIEW_BLOCK_BYTES)
            self._view_block.bind_to_uniform_block(BLOCK_BINDINGS["View"])
        self.set_lights(LightSpec())

    def set_lights(self, lights: LightSpec) -> None:
        """Switch the street lights and windows; they are all in order until this is called."""
        with self._context:
            self._lamp_field.set_lights(lights)
            self._shading.set_windows(lights)

    def render(self, cameras: Sequence[CameraView], frame: RenderFrame) -> list[CameraImages]:
        """Images of the ego's cameras at one moment, in the order of ``cameras``.

        Raises:
            RenderError: The world has too many actors, or ids above 65535.
        """
        ego = frame.world.ego
        origin_m = np.array([ego["x"], ego["y"], ego["z"]])
        with self._context:
            flow = any("flow" in camera.modalities for camera in cameras)
            table = RigidTable.of(self._models, frame.world, frame.previous if flow else None, origin_m)
            self._rigid.upload(table)
            views = [View.of(camera, frame.world, frame.previous, origin_m) for camera in cameras]
            colored = [view for camera, view in zip(cameras, views, strict=True) if "rgb" in camera.modalities]
            if colored:
                self._prepare_light(frame, table, origin_m, colored)
            return [
                self._render_view(view, set(camera.modalities), frame, table, origin_m)
                for camera, view in zip(cameras, views, strict=True)
            ]

    def close(self) -> None:
        """Free the context with all that was uploaded; the renderer cannot be used afterwards."""
        self._context.release()

    def _upload(self, static: StaticScene, library: ProgramLibrary) -> tuple[StaticGeometry, ActorGeometry]:
        of_static, of_actors = (
            {
                "geometry": library.load(f"{kind}_geometry.vert", "geometry.frag"),
                "shadow": library.load(f"{kind}_shadow.vert", "shadow.frag"),
            }
            for kind in ("static", "actor")
        )
        of_actors["coarse_shadow"] = of_actors["shadow"]
        classes = shading_class_of_material()
        return (
            StaticGeometry(self._context, static.tiles, of_static, classes),
            ActorGeometry(self._context, self._models, of_actors, classes),
        )

    def _prepare_light(
        self, frame: RenderFrame, table: RigidTable, origin_m: Float64Array, views: Sequence[View]
    ) -> None:
        """What all views of a frame share: sun, shadow maps, lamps and signals."""
        world = frame.world
        sky = SkyLight.of(world.weather)
        shadows = self._shadow_map.draw(sky.key_direction, origin_m, self._static, self._actors, world, table, views)
        self._contact_map.draw(world, origin_m)
        lamps = self._lamp_field.draw(world, origin_m, sky.lamps_lit)
        block_head = sky.block_head(world.weather, world.stamp_ns, origin_m, HALF_M)
        self._shading.set_light(sky.lamps_lit, block_head, *shadows, lamps)
        self._shading.set_signals(world.signals)

    def _render_view(
        self, view: View, wanted: set[Modality], frame: RenderFrame, table: RigidTable, origin_m: Float64Array
    ) -> CameraImages:
        targets = self._targets_of(view.camera)
        self._view_block.write(view.block())
        self._draw_geometry(targets, view, frame, table, origin_m)
        targets.bind()
        if "rgb" in wanted:
            self._shading.draw(targets)
        return CameraImages(
            rgb=read_image(targets.rgb, components=3) if "rgb" in wanted else None,
            semantic=read_image(targets.geometry, 3) if "semantic" in wanted else None,
            instance=read_image(targets.geometry, 4) if "instance" in wanted else None,
            depth=read_image(targets.geometry, 1) if "depth" in wanted else None,
            flow=read_image(targets.geometry, 5) if "flow" in wanted else None,
        )

    def _draw_geometry(
        self, targets: Targets, view: View, frame: RenderFrame, table: RigidTable, origin_m: Float64Array
    ) -> None:
        """Fill the G-buffer; the sky last, where nothing else is."""
        context, world = self._context, frame.world
        targets.geometry.use()
        targets.geometry.clear()
        context.enable_only(moderngl.DEPTH_TEST)
        context.front_face = "cw"  # image rows run downward, which mirrors every triangle
        context.depth_func = "<"
        self._static.draw_view("geometry", view, origin_m, targets.geometry)
        seen = visible_actors(world, table, view, Occluders.of(targets.geometry), frame.show_ego)
        self._actors.draw("geometry", world, table, seen)
        context.depth_func = "<="
        draw_screen(self._background)
        context.enable_only(moderngl.NOTHING)

    def _targets_of(self, camera: PinholeCamera) -> Targets:
        size_px = (camera.width_px, camera.height_px)
        if size_px not in self._targets:
            self._targets[size_px] = Targets(self._context, size_px, self._visibility_step)
        return self._targets[size_px]
