"""Lens distortion and sensor noise: converts images of an ideal camera into those of the real camera.

The G-buffer belongs to an ideal (distortion-free) camera with an image that contains the real one
(``geometry.camera.ideal_camera``). For a lens, the G-buffer also stores the screen-space slope of the depth and the
edges of each pixel's triangle. So the labels, depth and flow of a pixel are exact for its own ray: among the triangles
that the four nearest ideal pixels show, it takes the nearest one that the ray hits. The color image is interpolated.

For a fisheye, there are several ideal cameras, one per face of a cube (``geometry.fisheye.cube_faces``). Each one in
turn adds the pixels with rays that belong to its face; drops on the lens and sensor noise follow after the last one.
"""

import math
from collections.abc import Sequence

import moderngl
import numpy as np

from simbev_ros.config.modalities import IMAGE_KINDS, Modality
from simbev_ros.config.optics import Optics
from simbev_ros.foundation.geometry.camera import LensCamera, PinholeCamera
from simbev_ros.foundation.geometry.fisheye import Face, FisheyeCamera
from simbev_ros.foundation.types import Float32Array
from simbev_ros.simulation.render.frame import CameraView
from simbev_ros.simulation.render.gl.programs import TEXTURE_UNITS, ProgramLibrary
from simbev_ros.simulation.render.gl.screen_pass import ScreenPass
from simbev_ros.simulation.render.gl.targets import Image, Targets
from simbev_ros.simulation.render.shutter import MotionTimes, Shutters
from simbev_ros.simulation.render.view import View

_GEOMETRIC: tuple[Modality, ...] = ("semantic", "instance", "depth", "flow")
"""Modalities of a distorted camera that are computed together, in the order of the outputs of the shader."""
_NOISE_FREE_ELECTRONS = 1e12
"""Electrons at white that stand for a sensor without noise."""


class Lenses:
    """Lens and sensor passes of all cameras, each compiled when it is first used, as most cameras are ideal."""

    def __init__(self, context: moderngl.Context, library: ProgramLibrary, shutters: Shutters) -> None:
        """Store the context and the shader library; nothing is compiled yet."""
        self._context, self._library, self._shutters = context, library, shutters
        self._passes: dict[str, ScreenPass] = {}
        self._rays: dict[PinholeCamera, moderngl.Texture] = {}
        self._geometry: dict[tuple[int, int], moderngl.Framebuffer] = {}
        self._color: dict[tuple[int, int], moderngl.Framebuffer] = {}
        self._fisheye_color: dict[tuple[int, int], moderngl.Framebuffer] = {}
        self._from_depth: dict[Modality, dict[tuple[int, int], moderngl.Framebuffer]] = {}

    def images(self, view: CameraView, ideal: View, times: MotionTimes, targets: Targets) -> dict[Modality, Image]:
        """Attachments that hold a camera's images; its ideal camera's ``targets`` must be drawn and bound.

        Those of a fisheye are complete after the last face, and its color image after ``sensed_fisheye``. Unless the
        times of the shutter are 0, the motion must be drawn, too.
        """
        images = targets.images
        if times.exposed or view.rolls:
            self._bind_rays(view.camera)
        if times.exposed:
            images["rgb"] = self._shutters.exposed_color(view.camera, times, targets.rgb)
        if times.per_row:
            self._shutters.roll_rays(view.camera, times)
        if ideal.camera != view.camera and set(view.modalities) != {"rgb"}:
            geometry = self._draw_geometry(view, ideal.face, times)
            images |= {modality: Image(geometry, index) for index, modality in enumerate(_GEOMETRIC)}
        if "rgb" in view.modalities and not times.exposed:
            images["rgb"] = Image(self._draw_color(view, targets.rgb, ideal.face), 0, components=3)
        for modality in view.modalities:
            if modality not in images:
                images[modality] = Image(self._draw_from_depth(view.camera, modality, images["depth"]), 0)
        return images

    def fisheye_color(self, camera: PinholeCamera) -> tuple[moderngl.Framebuffer, moderngl.Framebuffer]:
        """The color image that the faces of a fisheye add up to, and a framebuffer of its size that is free."""
        whole, free = (self._target(each, camera, [(4, "f1")]) for each in (self._fisheye_color, self._color))
        return whole, free

    def sensed_fisheye(self, view: CameraView) -> Image:
        """Attachment that holds the color image of a fisheye, with the effects of its sensor."""
        return Image(self._draw_color(view, self.fisheye_color(view.camera)[0], None), 0, components=3)

    def _draw_geometry(self, view: CameraView, face: Face | None, times: MotionTimes) -> moderngl.Framebuffer:
        """Draw all modalities except rgb; returns them as attachments, in the order of ``_GEOMETRIC``."""
        camera, rolls = view.camera, times.per_row > 0.0
        target = self._target(self._geometry, camera, [IMAGE_KINDS[name].texel for name in _GEOMETRIC])
        screen_pass = self._lens_pass("lens_geometry.frag", view, face, ROLLING=rolls)
        program = screen_pass.program
        program["lens_intrinsics"] = camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px
        if isinstance(camera, FisheyeCamera):
            program["lens_radial"] = camera.distortion
            program["max_angle"] = camera.seen_angle_rad
        else:
            k1, k2, p1, p2, k3 = camera.distortion if isinstance(camera, LensCamera) else (0.0,) * 5
            max_radius2 = camera.max_radius2 if isinstance(camera, LensCamera) else math.inf
            program["lens_radial"] = k1, k2, k3, max_radius2
            program["lens_tangential"] = p1, p2
        if rolls:
            program["rows"] = times.per_row, times.middle_row
        screen_pass.draw(target)
        return target

    def _draw_color(self, view: CameraView, ideal: moderngl.Framebuffer, face: Face | None) -> moderngl.Framebuffer:
        """Draw the color image, or what a face adds to it; returns ``ideal`` if lens and sensor change nothing."""
        camera, optics = view.camera, view.optics
        distorts = isinstance(camera, LensCamera) or face is not None or view.rolls
        darkens = bool(optics.vignetting) and optics.imager is None  # an imager darkens the light itself
        senses = face is None and (darkens or optics.noise is not None)
        if not (distorts or senses or isinstance(camera, FisheyeCamera)):
            return ideal
        screen_pass = self._lens_pass("lens_color.frag", view, face, DISTORTED=distorts, SENSOR=senses)
        if senses:
            _set_sensor(screen_pass.program, optics, view.noise_seed)
        image = ideal.color_attachments[0]
        assert isinstance(image, moderngl.Texture)
        image.use(TEXTURE_UNITS["ideal_rgb"])
        target = self._target(self._color if face is None else self._fisheye_color, camera, [(4, "f1")])
        screen_pass.draw(target)
        return target

    def _draw_from_depth(self, camera: PinholeCamera, modality: Modality, depth: Image) -> moderngl.Framebuffer:
        """Draw a modality that has a shader of its own, from the depth at the camera's pixels."""
        kind = IMAGE_KINDS[modality]
        assert kind.shader is not None
        self._bind_rays(camera)
        depth.texture.use(TEXTURE_UNITS["pixel_depth"])
        target = self._target(self._from_depth.setdefault(modality, {}), camera, [kind.texel])
        self._pass(kind.shader).draw(target)
        return target

    def _bind_rays(self, camera: PinholeCamera) -> None:
        """Bind the texture of a camera's pixel rays: as in shaders/include/fisheye.glsl, or x and y where z is 1."""
        if camera not in self._rays:
            size_px = (camera.width_px, camera.height_px)
            rays = _ray_texels(camera)
            self._rays[camera] = self._context.texture(size_px, rays.shape[1], rays.tobytes(), dtype="f4")
            self._rays[camera].filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._rays[camera].use(TEXTURE_UNITS["lens_rays"])

    def _lens_pass(self, fragment: str, view: CameraView, face: Face | None, **constants: bool) -> ScreenPass:
        """The pass of a shader for a camera, or for a face of it, with its rays bound; those that roll already are."""
        camera = view.camera
        if isinstance(camera, LensCamera | FisheyeCamera) and not view.rolls:
            self._bind_rays(camera)
        if isinstance(camera, FisheyeCamera):
            constants["FISHEYE"] = True
        screen_pass = self._pass(fragment, "true" if face is None else "in_face(pixel)", **constants)
        if face is not None:
            screen_pass.program["face_from_optical"] = face.optical_from_face.ravel().tolist()  # by columns
        return screen_pass

    def _pass(self, fragment: str, condition: str = "true", **constants: bool) -> ScreenPass:
        key = f"{fragment} {condition} {constants}"
        if key not in self._passes:
            macros = {name: int(value) for name, value in constants.items()}
            self._passes[key] = self._library.screen_pass(fragment, condition, **macros)
        return self._passes[key]

    def _target(
        self,
        targets: dict[tuple[int, int], moderngl.Framebuffer],
        camera: PinholeCamera,
        attachments: Sequence[tuple[int, str]],
    ) -> moderngl.Framebuffer:
        """Framebuffer of a camera's size, with textures of the given component counts and types."""
        size_px = (camera.width_px, camera.height_px)
        if size_px not in targets:
            textures = [self._context.texture(size_px, count, dtype=dtype) for count, dtype in attachments]
            targets[size_px] = self._context.framebuffer(textures)
        return targets[size_px]


def _ray_texels(camera: PinholeCamera) -> Float32Array:
    """(H·W, 2 or, of a fisheye, 4) texels of the texture of a camera's pixel rays."""
    rows, columns = np.mgrid[: camera.height_px, : camera.width_px]
    rays = camera.rays(np.stack([columns.ravel(), rows.ravel()], axis=1))
    if not isinstance(camera, FisheyeCamera):
        return rays[:, :2].astype(np.float32)
    seen = ~np.isnan(rays[:, :1])
    texels = np.where(seen, np.column_stack([rays, camera.relative_illumination(rays)]), [0.0, 0.0, 0.0, 1.0])
    return texels.astype(np.float32)


def _set_sensor(program: moderngl.Program | moderngl.ComputeShader, optics: Optics, noise_seed: int) -> None:
    """Set the uniforms of shaders/include/lens.glsl."""
    program["vignetting"] = optics.vignetting
    noise = optics.noise
    program["electrons"] = (
        (_NOISE_FREE_ELECTRONS, 0.0) if noise is None else (optics.white_electrons, noise.read_sigma_electrons**2)
    )
    program["noise_seed"] = noise_seed & 0xFFFFFFFF, noise_seed >> 32
