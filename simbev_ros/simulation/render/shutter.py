"""Shutter of a camera: blurs what moves during the exposure, and reads rows one after the other.

The G-buffer and the ideal color image are of one moment; ``motion.frag`` adds the exact velocity of each of its points
relative to the camera, which the point keeps. What a pixel sees at another time is found by following the motions that
occur nearby back to the G-buffer (shaders/include/moving.glsl): of the surfaces that arrive at the pixel at that time,
the nearest one is seen.

A rolling shutter thereby replaces the rays of a camera's pixels, from which ``Lenses`` makes all its images. An
exposure is the mean light of several times.
"""

from dataclasses import dataclass
from typing import Self

import moderngl

from simbev_ros.foundation.geometry.camera import PinholeCamera
from simbev_ros.simulation.render.frame import MOTION_S, CameraView
from simbev_ros.simulation.render.gl.programs import TEXTURE_UNITS, ProgramLibrary
from simbev_ros.simulation.render.gl.screen_pass import ScreenPass
from simbev_ros.simulation.render.gl.targets import Image
from simbev_ros.simulation.render.view import View

_TILE_PX = 32
"""Size of the tiles of shaders/include/moving.glsl."""
_STILL_PX, _FAST_RAD_PER_S = 1.0, 3.0
"""An exposure is one moment if a surface that is as fast, seen from the camera, moves by fewer pixels."""


@dataclass(frozen=True, slots=True)
class MotionTimes:
    """Times of a shutter as the shaders need them: in ``MOTION_S``, in which they know the motion.

    Attributes:
        exposed: Exposure time; 0 if nothing is blurred.
        per_row: Time from a row to the next one; 0 if all are of one moment.
        middle_row: The row whose exposure has its middle at the stamp.
    """

    exposed: float
    per_row: float
    middle_row: float

    @classmethod
    def of(cls, view: View, camera: CameraView) -> Self:
        """Times of the images of a camera, posed in a view."""
        last = camera.camera.height_px - 1
        times = view.shutter
        if times is None or view.before_optical_from_world is None:
            return cls(0.0, 0.0, last / 2.0)
        blurs = times.exposure_s * _FAST_RAD_PER_S * camera.camera.fx_px > _STILL_PX and "rgb" in camera.modalities
        exposed_s = times.exposure_s if blurs else 0.0
        return cls(exposed_s / MOTION_S, times.readout_s / MOTION_S / last, last / 2.0)


class Shutters:
    """Shutter passes of all cameras, each compiled when it is first used."""

    def __init__(self, context: moderngl.Context, library: ProgramLibrary) -> None:
        """Store the context and the shader library; nothing is compiled yet."""
        self._context, self._library = context, library
        self._passes: dict[str, ScreenPass] = {}
        self._targets: dict[tuple[str, tuple[int, int]], moderngl.Framebuffer] = {}

    def draw_motion(self, view: View) -> None:
        """Draw the motion in a view, for the other methods; G-buffer, rigid parts and poses of it must be bound."""
        size_px = view.camera.width_px, view.camera.height_px
        tiles_px = -(-size_px[0] // _TILE_PX), -(-size_px[1] // _TILE_PX)
        motion = self._draw("motion", size_px, [(4, "f4")])
        _bind(motion, "g_motion")
        _bind(self._draw("motion_tiles", tiles_px, [(4, "f4")] * 2, AROUND=False), "fastest", "slowest")
        _bind(self._draw("motion_tiles", tiles_px, [(4, "f4")] * 2, AROUND=True), "fastest", "slowest")

    def roll_rays(self, camera: PinholeCamera, times: MotionTimes) -> None:
        """Replace a camera's rays, which must be bound, by those of what each row sees at its time."""
        size_px = camera.width_px, camera.height_px
        _bind(self._draw("rolling", size_px, [(2, "f4")], time_per_row=times.per_row), "lens_rays")

    def exposed_color(self, camera: PinholeCamera, times: MotionTimes, ideal: moderngl.Framebuffer) -> Image:
        """Color image of the exposure, from that of the ideal camera; the camera's rays must be bound."""
        _bind(ideal, "ideal_rgb")
        light = self._draw("light", ideal.size, [(4, "f2")])
        _bind(light, "g_light")
        size_px = camera.width_px, camera.height_px
        uniforms = {"time_per_row": times.per_row, "exposed_time": times.exposed}
        return Image(self._draw("exposure", size_px, [(4, "f1")], **uniforms), 0, components=3)

    def spare(self, camera: PinholeCamera) -> moderngl.Framebuffer:
        """A framebuffer of the size of a camera's color image that is free."""
        return self._target("spare", (camera.width_px, camera.height_px), [(4, "f1")], moderngl.LINEAR)

    def _draw(
        self,
        shader: str,
        size_px: tuple[int, int],
        attachments: list[tuple[int, str]],
        **settings: float,
    ) -> moderngl.Framebuffer:
        """Draw a pass into its framebuffer; its settings are macros if they are of type bool, else uniforms."""
        macros = {name: int(value) for name, value in settings.items() if isinstance(value, bool)}
        key = f"{shader} {macros}"
        if key not in self._passes:
            self._passes[key] = self._library.screen_pass(f"{shader}.frag", "true", **macros)
        target = self._target(key, size_px, attachments, moderngl.LINEAR if shader == "light" else moderngl.NEAREST)
        for name in settings.keys() - macros.keys():
            self._passes[key].program[name] = settings[name]
        self._passes[key].draw(target)
        return target

    def _target(
        self, key: str, size_px: tuple[int, int], attachments: list[tuple[int, str]], texture_filter: int
    ) -> moderngl.Framebuffer:
        if (key, size_px) not in self._targets:
            textures = [self._context.texture(size_px, count, dtype=dtype) for count, dtype in attachments]
            for texture in textures:
                texture.repeat_x = texture.repeat_y = False
                texture.filter = texture_filter, texture_filter
            self._targets[key, size_px] = self._context.framebuffer(textures)
        return self._targets[key, size_px]


def _bind(target: moderngl.Framebuffer, *samplers: str) -> None:
    """Bind the attachments of a framebuffer to samplers."""
    for texture, sampler in zip(target.color_attachments, samplers, strict=True):
        assert isinstance(texture, moderngl.Texture)
        texture.use(TEXTURE_UNITS[sampler])
