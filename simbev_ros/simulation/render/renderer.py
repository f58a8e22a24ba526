"""The renderer: draws the exact images of the ego's cameras from meshes and a world state.

``CameraView``s and a ``RenderFrame`` enter ``Renderer.render``, ``CameraImages`` leave; there is one geometry pass per
camera. Images of several agents take one call per agent, in any order.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from zlib import crc32

import moderngl
import numpy as np

from simbev_ros.assets.actors.actor_model import ActorModel
from simbev_ros.assets.actors.skeletons import Skeletons
from simbev_ros.assets.placement.static_scene import StaticScene
from simbev_ros.config.rendering import Quality
from simbev_ros.foundation.geometry.camera import PinholeCamera
from simbev_ros.foundation.geometry.fisheye import FisheyeCamera
from simbev_ros.foundation.types import Float64Array
from simbev_ros.schema.scene.appearance import AppearanceSpec
from simbev_ros.schema.scene.lights import LightSpec
from simbev_ros.simulation.render.frame import CameraImages, CameraView, RenderFrame
from simbev_ros.simulation.render.geometry.actor_geometry import ActorGeometry, visible_actors
from simbev_ros.simulation.render.geometry.occlusion import Occluders
from simbev_ros.simulation.render.geometry.rigid_table import RigidTable, RigidTextures
from simbev_ros.simulation.render.geometry.static_geometry import StaticGeometry
from simbev_ros.simulation.render.geometry.triangle_ids import TriangleIds
from simbev_ros.simulation.render.gl.context import open_context
from simbev_ros.simulation.render.gl.depth_history import DepthHistory
from simbev_ros.simulation.render.gl.devices import is_software
from simbev_ros.simulation.render.gl.failures import check_memory
from simbev_ros.simulation.render.gl.programs import BLOCK_BINDINGS, ProgramLibrary, quality_steps
from simbev_ros.simulation.render.gl.readback import create_read_back
from simbev_ros.simulation.render.gl.targets import Targets
from simbev_ros.simulation.render.gl.timer import Timer, null_timer
from simbev_ros.simulation.render.image_sensor import form_images
from simbev_ros.simulation.render.lens import Lenses
from simbev_ros.simulation.render.lighting.contact_shadows import HALF_M, ContactMap
from simbev_ros.simulation.render.lighting.lamp_field import LampField
from simbev_ros.simulation.render.lighting.lamps import VehicleLamps
from simbev_ros.simulation.render.lighting.light import SkyLight
from simbev_ros.simulation.render.lighting.shadows import ShadowMap
from simbev_ros.simulation.render.lighting.sky_dome import SkyDome
from simbev_ros.simulation.render.lighting.sky_view import SkyViewMap
from simbev_ros.simulation.render.lighting.tunnel_map import TunnelAdaptation, TunnelMap
from simbev_ros.simulation.render.outlines import outline_images
from simbev_ros.simulation.render.shading.noise import noise_texture
from simbev_ros.simulation.render.shading.shading import Shading
from simbev_ros.simulation.render.shutter import MotionTimes, Shutters
from simbev_ros.simulation.render.view import VIEW_BLOCK_BYTES, View

READ_BACK = "read-back"
"""The part of a frame, as timers see it, in which images are copied from OpenGL and waited for."""


class Renderer:
    """Draws a static scene and its actors with OpenGL. Each instance must be used by a single thread."""

    def __init__(
        self,
        static: StaticScene,
        models: Sequence[ActorModel],
        context: moderngl.Context | None = None,
        quality: Quality = "medium",
        timer: Timer = null_timer,
        use_compute: bool | None = None,
    ) -> None:
        """Upload the meshes and compile the shaders.

        Args:
            static: The static scene.
            models: The catalog's models, indexed by blueprint.
            context: Context from ``open_context``; by default a new one.
            quality: Quality of the color image.
            timer: Context manager factory that is entered around each part of a frame.
            use_compute: Use compute shaders instead of rasterization where possible; by default on GPUs. The images are
                the same.

        Raises:
            RenderError: OpenGL is not usable here, or has too little memory.
        """
        self._context = open_context() if context is None else context
        self._on_gpu = not is_software(self._context.info["GL_RENDERER"]) if use_compute is None else use_compute
        self._read_back = create_read_back(self._context, self._on_gpu)
        self._models, self._skeletons = models, Skeletons(models)
        self._timer = timer
        self._targets: dict[tuple[int, int, bool], Targets] = {}
        size_bytes = sum(tile.mesh.vertices.nbytes * 3 + tile.mesh.triangles.nbytes for tile in static.tiles)
        with self._context, check_memory(self._context, "the meshes of the scene", size_bytes):
            has_tunnels = bool(static.tunnels)
            library = ProgramLibrary(self._context, quality, use_compute=self._on_gpu, tunnels=has_tunnels)
            self._steps = quality_steps(quality)
            self._static, self._actors = self._upload(static, library)
            self._background = library.raster_pass("background.frag")
            self._background_for_lens = library.raster_pass("background.frag", LENS=1)
            self._triangle_ids = TriangleIds(self._context, library) if self._on_gpu else None
            self._shading = Shading(self._context, library, timer)
            self._shutters = Shutters(self._context, library)
            self._lenses = Lenses(self._context, library, self._shutters)
            self._shadow_map = ShadowMap(self._context, quality)
            self._sky_dome = SkyDome(self._context, library)
            self._lamp_field = LampField(self._context, library, static, VehicleLamps(models))
            self._contact_map = ContactMap(self._context, library)
            self._sky_view = SkyViewMap(self._context)
            self._tunnel_map = TunnelMap(self._context, library, static.tunnels)
            self._noise = noise_texture(self._context)
            self._rigid, self._moving = RigidTextures(self._context), RigidTextures(self._context)
            self._history = DepthHistory(self._context)
            self._view_block = self._context.buffer(reserve=VIEW_BLOCK_BYTES)
            self._view_block.bind_to_uniform_block(BLOCK_BINDINGS["View"])
        self.set_lights(LightSpec())

    def set_lights(self, lights: LightSpec) -> None:
        """Switch the street lights and windows; until this is called, all of them work."""
        with self._context:
            self._lamp_field.set_lights(lights)
            self._shading.set_windows(lights)

    def set_appearance(self, appearance: AppearanceSpec) -> None:
        """Change the colors of surfaces and light; until this is called, they are plausible."""
        with self._context:
            self._shading.set_appearance(appearance)

    def set_agents(self, count: int) -> None:
        """Keep the maps that are around this number of agents; until this is called, those around one.

        Images do not depend on it, but if agents share too few maps, each call draws them again.
        """
        self._shadow_map.set_agents(count)
        self._tunnel_map.set_agents(count)
        self._sky_view.set_agents(count)

    def render(self, cameras: Sequence[CameraView], frame: RenderFrame) -> list[CameraImages]:
        """Draw the images of the ego's cameras at one tick, in the order of ``cameras``.

        Raises:
            RenderError: The world has too many rigid parts, or actor ids above 65535, or memory runs out.
        """
        requested, cameras = cameras, [camera.drawn for camera in cameras]
        self._complete_history(cameras, frame)
        ego = frame.world.ego
        origin_m = np.array([ego["x"], ego["y"], ego["z"]])
        with self._context, check_memory(self._context, f"images of {len(cameras)} cameras"):
            flow = any("flow" in camera.modalities for camera in cameras)
            self._actors.hold(frame.world)
            table = RigidTable.from_world(self._skeletons, frame.world, frame.previous if flow else None, origin_m)
            before = frame.shortly_before if any(camera.shutter for camera in cameras) else None
            if before is not None:
                self._moving.upload(RigidTable.from_world(self._skeletons, frame.world, before, origin_m))
            self._rigid.upload(table)
            adaptation = self._tunnel_map.adaptation(origin_m, SkyLight.from_weather(frame.world.weather))
            views = [
                View.of_camera(
                    camera,
                    frame.world,
                    frame.previous if "flow" in camera.modalities else None,
                    origin_m,
                    adaptation.factor,
                    before,
                )
                for camera in cameras
            ]
            colored = [
                view for camera, each in zip(cameras, views, strict=True) if "rgb" in camera.modalities for view in each
            ]
            if colored:
                self._prepare_light(frame, table, origin_m, colored, adaptation)
            images = [
                self._render_camera(camera, each, frame, table, origin_m)
                for camera, each in zip(cameras, views, strict=True)
            ]
            with self._timer(READ_BACK):
                self._read_back.finish()
        formed = [
            form_images(camera, image, each[0].shutter.amplification if each[0].shutter else 1.0)
            for camera, image, each in zip(requested, images, views, strict=True)
        ]
        return [outline_images(camera, image) for camera, image in zip(requested, formed, strict=True)]

    def close(self) -> None:
        """Free the context with all that was uploaded; the renderer cannot be used afterwards."""
        self._context.release()

    def _complete_history(self, cameras: Sequence[CameraView], frame: RenderFrame) -> None:
        """Draw the previous images that the flow is relative to, if they were not the last ones that were drawn."""
        previous, show_ego = frame.previous, frame.show_ego
        flow = [replace(camera, modalities=("flow",)) for camera in cameras if "flow" in camera.modalities]
        if previous is None:
            return
        if missing := [camera for camera in flow if not self._history.has(camera, previous, show_ego=show_ego)]:
            self.render(missing, RenderFrame(previous, show_ego=show_ego))

    def _upload(self, static: StaticScene, library: ProgramLibrary) -> tuple[StaticGeometry, ActorGeometry]:
        static_programs, actor_programs = (
            {
                "geometry": library.load(f"{kind}_geometry.vert", "geometry.frag"),
                "geometry_for_lens": library.load(f"{kind}_geometry.vert", "geometry.frag", "corners.geom", LENS=1),
                "shadow": library.load(f"{kind}_shadow.vert", "shadow.frag"),
                **({"id": library.load(f"{kind}_id.vert", "id.frag")} if library.use_compute else {}),
            }
            for kind in ("static", "actor")
        )
        return (
            StaticGeometry(self._context, static.tiles, static_programs),
            ActorGeometry(self._context, self._models, actor_programs),
        )

    def _prepare_light(
        self,
        frame: RenderFrame,
        table: RigidTable,
        origin_m: Float64Array,
        views: Sequence[View],
        adaptation: TunnelAdaptation,
    ) -> None:
        """Prepare what all views of a frame share: sun, shadow maps, lamps and signals."""
        world = frame.world
        sky = SkyLight.from_weather(world.weather)
        with self._timer("shadows"):
            shadows = self._shadow_map.draw(
                sky.key_direction, origin_m, self._static, self._actors, world, table, views
            )
        self._contact_map.draw(world, origin_m)
        if sky.lamps_lit:
            lamps = self._lamp_field.draw(world, origin_m)
            hidden = () if frame.show_ego else np.flatnonzero(np.isin(world.actors["id"], list(world.ego_ids)))
            wet = world.weather.wetness > 0.0
            self._shading.glare.set_lamps(lamps[~np.isin(lamps["row"], hidden)], wet)
            self._shading.fog_glow.set_lamps(lamps, world.weather)
        block_head = sky.block_head(world.weather, world.stamp_ns, origin_m, HALF_M)
        block_head[0, 3] *= adaptation.factor
        matrices = [*shadows, LampField.texture_from_world()]
        maps = np.vstack([self._tunnel_map.draw(origin_m, adaptation), self._sky_view.draw(origin_m, self._static)])
        self._shading.set_light(sky.lamps_lit, block_head, matrices, maps)
        self._sky_dome.draw(sky, block_head)
        self._shading.set_signals(world.signals)
        self._shading.rain.set_world(world, origin_m, adaptation.inside)
        self._shading.spray.set_world(world, origin_m)
        self._shading.wetness.set_weather(world.weather)

    def _render_camera(
        self, camera: CameraView, views: Sequence[View], frame: RenderFrame, table: RigidTable, origin_m: Float64Array
    ) -> CameraImages:
        """Draw one camera, view by view; its images are complete after ``ReadBack.finish``."""
        has_flow, is_fisheye = "flow" in camera.modalities, isinstance(camera.camera, FisheyeCamera)
        seed = crc32(camera.ego_from_sensor.tobytes(), camera.lens_seed)
        if has_flow and frame.previous is not None:
            self._history.bind(camera, frame.previous, show_ego=frame.show_ego)
        for view in views:
            for_lens = view.camera != camera.camera
            targets = self._targets_for(view.camera, for_lens)
            self._view_block.write(view.block())
            with self._timer("geometry, labels, flow"):
                self._draw_geometry(targets, view, frame, table, origin_m, for_lens)
            targets.bind()
            if "rgb" in camera.modalities:
                self._shading.draw(targets, None if is_fisheye or camera.shutter else seed)
            with self._timer("lens"):
                times = MotionTimes.of(view, camera)
                if times.exposed or times.per_row:
                    self._moving.bind()
                    self._view_block.write(view.motion_block())
                    self._shutters.draw_motion(view)
                    self._rigid.bind()
                    self._view_block.write(view.block())
                images = self._lenses.images(camera, view, times, targets)
        if is_fisheye and "rgb" in camera.modalities:
            self._view_block.write(replace(views[0], camera=camera.camera).block())
            self._shading.rain.draw_lens_drops(*self._lenses.fisheye_color(camera.camera), seed)
            images["rgb"] = self._lenses.sensed_fisheye(camera)
        elif camera.shutter and "rgb" in camera.modalities:  # drops do not move with what is behind them
            self._view_block.write(replace(views[0], camera=camera.camera).block())
            spare = self._shutters.spare(camera.camera)
            self._shading.rain.draw_lens_drops(images["rgb"].framebuffer, spare, seed)
        if has_flow:
            self._history.store(camera, frame.world, images["depth"], show_ego=frame.show_ego)
        with self._timer(READ_BACK):
            return CameraImages(**{modality: self._read_back.begin(images[modality]) for modality in camera.modalities})

    def _draw_geometry(
        self,
        targets: Targets,
        view: View,
        frame: RenderFrame,
        table: RigidTable,
        origin_m: Float64Array,
        for_lens: bool,
    ) -> None:
        """Fill the G-buffer; the sky comes last, where nothing else was drawn."""
        context, world = self._context, frame.world
        if self._triangle_ids is not None and not for_lens:
            visible = visible_actors(world, table, view, None, frame.show_ego)
            self._triangle_ids.draw(targets, view, origin_m, self._static, self._actors, world, table, visible)
            return
        program = "geometry_for_lens" if for_lens else "geometry"
        targets.geometry.use()
        targets.clear_depth()
        context.enable_only(moderngl.DEPTH_TEST)
        context.front_face = "cw"  # image rows run downward, which mirrors every triangle
        context.depth_func = "<"
        read_occluders = None if self._on_gpu else partial(Occluders.from_framebuffer, targets.geometry)
        self._static.draw_view(program, view, origin_m, read_occluders)
        visible = visible_actors(world, table, view, read_occluders, frame.show_ego)
        context.enable(moderngl.CULL_FACE)  # actors are closed
        self._actors.draw(program, world, table, visible, view.pixel_m(table.center_m, table.radius_m))
        context.disable(moderngl.CULL_FACE)
        context.depth_func = "<="
        (self._background_for_lens if for_lens else self._background).draw(targets.geometry)
        context.enable_only(moderngl.NOTHING)

    def _targets_for(self, camera: PinholeCamera, for_lens: bool) -> Targets:
        size_px = (camera.width_px, camera.height_px)
        if (*size_px, for_lens) not in self._targets:
            size_bytes = (84 if for_lens else 60) * size_px[0] * size_px[1]
            with check_memory(self._context, f"images of {size_px[0]} x {size_px[1]} pixels", size_bytes):
                self._targets[*size_px, for_lens] = Targets(self._context, size_px, self._steps, for_lens)
        return self._targets[*size_px, for_lens]
