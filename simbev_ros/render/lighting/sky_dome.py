"""The sky with its clouds as one map for all cameras of a frame, which see it, mirror it and are lit by it."""

import moderngl

from simbev_ros.config.rendering import QUALITIES
from simbev_ros.render.gl.programs import TEXTURE_UNITS, ProgramLibrary
from simbev_ros.render.lighting.light import CLEAR_HAZE_PER_M, SKY_SIZE_PX, SkyLight
from simbev_ros.types import Float64Array

_SIZES_PX = (320, 512, 1024)
"""Width of the map, of each quality."""


class SkyDome:
    """The map: radiance, and the share of light from beyond the clouds that comes through."""

    def __init__(self, context: moderngl.Context, library: ProgramLibrary) -> None:
        self._context = context
        size_px = _SIZES_PX[QUALITIES.index(library.quality)]
        self._table = context.texture((SKY_SIZE_PX, SKY_SIZE_PX), 3, dtype="f4")
        self._table.use(TEXTURE_UNITS["sky_table"])
        dome = context.texture((size_px, size_px), 4, dtype="f2")
        for texture in (self._table, dome):
            texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
            texture.repeat_x = texture.repeat_y = False
        dome.use(TEXTURE_UNITS["sky_dome"])
        self._dome = context.framebuffer([dome])
        self._pass = library.screen_pass("sky_dome.frag", HAZE=CLEAR_HAZE_PER_M)
        self._pass.program["size"] = size_px
        self._shown = b""

    def draw(self, sky: SkyLight, block_head: Float64Array) -> None:
        """Draw the map, unless it is drawn already. The uniform block ``Light`` must be that of the moment."""
        what = block_head[:9].copy()
        what[6, 3] = 0.0  # seconds, of which the map knows by the clouds' drift only
        if what.tobytes() == self._shown:
            return
        self._shown = what.tobytes()
        self._table.write(sky.sky.astype("f4").tobytes())
        self._context.enable_only(moderngl.NOTHING)
        self._pass.draw(self._dome)
