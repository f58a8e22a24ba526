"""Wet ground: its own shader in the place of the dry one, and after all is shaded, what it mirrors of the picture."""

import moderngl

from simbev_ros.config.rendering import QUALITIES
from simbev_ros.render.programs import TEXTURE_UNITS, ProgramLibrary, draw_screen
from simbev_ros.render.targets import Targets
from simbev_ros.scene.weather import Weather


class Wetness:
    """Programs of wet ground, compiled when it first is wet: dry ground knows nothing of water."""

    def __init__(self, context: moderngl.Context, library: ProgramLibrary) -> None:
        self._context, self._library = context, library
        self._grounds: dict[bool, moderngl.VertexArray] = {}
        self._mirror: moderngl.VertexArray | None = None
        self.wet = False

    def set_weather(self, weather: Weather) -> None:
        """Set whether the ground is wet."""
        self.wet = weather.wetness > 0.0 or weather.precipitation_deposits > 0.0

    def ground(self, lamps_lit: bool) -> moderngl.VertexArray:
        """The screen pass that shades wet ground."""
        if lamps_lit not in self._grounds:
            self._grounds[lamps_lit] = self._library.screen_pass("shade_ground.frag", LAMPS_LIT=float(lamps_lit), WET=1)
        return self._grounds[lamps_lit]

    def draw_mirrored(self, targets: Targets, layer: float) -> None:
        """Add what wet ground, of a layer of the depth in ``targets.shaded``, mirrors of the rest of that image."""
        if not self.wet or QUALITIES.index(self._library.quality) == 0:
            return
        if self._mirror is None:
            self._mirror = self._library.screen_pass("wet_mirror.frag")
        self._context.copy_framebuffer(targets.rgb, targets.shaded)
        copy = targets.rgb.color_attachments[0]
        assert isinstance(copy, moderngl.Texture)
        copy.use(TEXTURE_UNITS["ideal_rgb"])
        targets.shaded.use()
        draw_screen(self._mirror, layer)
