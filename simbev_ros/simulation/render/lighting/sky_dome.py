"""The sky with its clouds as one map per frame: all cameras see it, surfaces reflect it and are lit by it."""

import moderngl

from simbev_ros.config.rendering import QUALITIES
from simbev_ros.foundation.types import Float64Array
from simbev_ros.simulation.render.gl.programs import TEXTURE_UNITS, ProgramLibrary
from simbev_ros.simulation.render.lighting.light import CLEAR_HAZE_PER_M, SKY_SIZE_PX, SkyLight

_SIZES_PX = (320, 512, 1024)
"""Width of the map, per quality."""


class SkyDome:
    """Map of sky radiance, and of the share of light from beyond the clouds that passes through them."""

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
        self._drawn_key = b""

    def draw(self, sky: SkyLight, block_head: Float64Array) -> None:
        """Draw the map if it has changed. The uniform block ``Light`` must be set for this frame."""
        key = block_head[:9].copy()
        key[6, 3] = 0.0  # seconds: the map depends on them only through the clouds' drift
        if key.tobytes() == self._drawn_key:
            return
        self._drawn_key = key.tobytes()
        self._table.write(sky.sky.astype("f4").tobytes())
        self._context.enable_only(moderngl.NOTHING)
        self._pass.draw(self._dome)
