"""Wet ground: replaces the dry ground's shader, and adds reflections of the image after everything is shaded."""

import moderngl

from simbev_ros.config.rendering import Quality
from simbev_ros.schema.scene.weather import Weather
from simbev_ros.simulation.render.gl.programs import TEXTURE_UNITS
from simbev_ros.simulation.render.gl.screen_pass import ScreenPass
from simbev_ros.simulation.render.gl.targets import Targets
from simbev_ros.simulation.render.shading.class_areas import ClassAreas


class Wetness:
    """Programs of wet ground, compiled when the ground is first wet, so that dry scenes do not pay for them."""

    def __init__(self, context: moderngl.Context, areas: ClassAreas, quality: Quality, ground: int) -> None:
        """Store the ``ClassAreas`` to draw with, and the number of the ground's shading class."""
        self._context, self._areas, self._quality, self._ground = context, areas, quality, ground
        self._grounds: dict[bool, ScreenPass] = {}
        self._mirror: ScreenPass | None = None
        self.wet = False

    def set_weather(self, weather: Weather) -> None:
        """Determine whether the ground is wet."""
        self.wet = weather.wetness > 0.0 or weather.precipitation_deposits > 0.0

    def ground_pass(self, lamps_lit: bool) -> ScreenPass:
        """The screen pass that shades wet ground."""
        if lamps_lit not in self._grounds:
            self._grounds[lamps_lit] = self._areas.surface_pass(
                "shade_ground.frag", self._ground, LAMPS_LIT=float(lamps_lit), WET=1
            )
        return self._grounds[lamps_lit]

    def draw_reflections(self, targets: Targets) -> None:
        """Add the reflections of the rest of ``targets.shaded`` on wet ground."""
        if not self.wet or self._quality == "low":
            return
        if self._mirror is None:
            self._mirror = self._areas.surface_pass("wet_mirror.frag", self._ground)
        self._context.copy_framebuffer(targets.rgb, targets.shaded)
        copy = targets.rgb.color_attachments[0]
        assert isinstance(copy, moderngl.Texture)
        copy.use(TEXTURE_UNITS["ideal_rgb"])
        self._mirror.draw(targets.shaded)
