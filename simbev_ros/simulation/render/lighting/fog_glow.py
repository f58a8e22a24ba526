"""Light of lamps that fog and rain scatter to the camera: halos around lamps, and beams of headlamps.

It is computed for every ``_STEP_PX``-th pixel in each direction, up to the surface that the pixel shows, and blended
over the shaded image. In clear air, nothing is compiled and nothing is drawn.
"""

import moderngl
import numpy as np

from simbev_ros.foundation.types import Table
from simbev_ros.scene.air import fog_halvings_per_m, rain_halvings_per_m
from simbev_ros.schema.scene.weather import Weather
from simbev_ros.simulation.render.gl.programs import TEXTURE_UNITS, ProgramLibrary
from simbev_ros.simulation.render.gl.screen_pass import RasterPass

_STEP_PX = 8
_MAX_LAMPS, _REACH_M = 48, 250.0
_MIN_LUX = 2e-3  # at the camera; weaker lamps have no visible halo
_FIELDS = ("at", "facing", "color", "glare_cd", "forward", "height_m", "beam")


class FogGlow:
    """Draws the halos of the lamps of a frame over the shaded image of each camera."""

    def __init__(self, context: moderngl.Context, library: ProgramLibrary) -> None:
        self._context, self._library = context, library
        self._lamps = context.buffer(reserve=_MAX_LAMPS * 13 * 4)
        self._passes: tuple[moderngl.VertexArray, RasterPass] | None = None
        self._halos: dict[tuple[int, int], tuple[moderngl.Texture, moderngl.Framebuffer]] = {}
        self._count, self._rain_per_m = 0, 0.0

    def set_lamps(self, lamps: Table, weather: Weather) -> None:
        """Set the (N,) ``LAMP_DTYPE`` rows that are lit, and the weather whose air scatters their light."""
        self._rain_per_m = rain_halvings_per_m(weather)
        halvings_per_m = fog_halvings_per_m(weather) + self._rain_per_m
        range_m = np.maximum(np.linalg.norm(lamps["at"].astype(np.float64), axis=1), 5.0)
        lux = lamps["glare_cd"] * np.exp2(-halvings_per_m * np.minimum(range_m, _REACH_M)) / range_m**2
        lux[(lux < _MIN_LUX) | (range_m > _REACH_M)] = 0.0
        self._count = min(int(np.count_nonzero(lux)), _MAX_LAMPS) if halvings_per_m > 0.0 else 0
        if self._count:
            lamps = lamps[np.argsort(-lux, kind="stable")[: self._count]]
            self._lamps.write(np.column_stack([lamps[name] for name in _FIELDS]).astype(np.float32).tobytes())

    def draw(self, image: moderngl.Framebuffer) -> None:
        """Draw over a shaded image; the G-buffer must be bound."""
        if not self._count:
            return
        if self._passes is None:
            program = self._library.load("halo.vert", "halo.frag", GLOW_STEP=_STEP_PX)
            names = ("in_at", "in_facing", "in_color", "in_form", "in_beam")
            lamps = self._context.vertex_array(program, [(self._lamps, "3f4 3f4 4f4 2f4 1f4/i", *names)])
            self._passes = lamps, self._library.raster_pass("enlarge.frag", SHADING_STEP=_STEP_PX)
        lamps, enlarge = self._passes
        if image.size not in self._halos:
            width_px, height_px = (-(-size_px // _STEP_PX) for size_px in image.size)
            texture = self._context.texture((width_px, height_px), 4, dtype="f1")
            texture.repeat_x = texture.repeat_y = False
            self._halos[image.size] = texture, self._context.framebuffer([texture])
        texture, halos = self._halos[image.size]
        texture.use(TEXTURE_UNITS["coarse_rgb"])
        halos.use()
        halos.clear()
        lamps.program["rain_depth"] = self._rain_per_m
        self._context.enable_only(moderngl.BLEND)
        self._context.blend_func = (moderngl.ONE_MINUS_DST_COLOR, moderngl.ONE)
        lamps.render(moderngl.TRIANGLE_STRIP, vertices=4, instances=self._count)
        enlarge.draw(image)
        self._context.enable_only(moderngl.NOTHING)
