"""Lamps as the camera sees them directly: bright points visible at any distance, glare, and streaks on wet roads."""

import moderngl
import numpy as np

from simbev_ros.foundation.types import Table
from simbev_ros.simulation.render.gl.programs import ProgramLibrary

_FAR_M = 500.0
_MAX_LAMPS = 1024
_MAX_STREAKS = 64


class Glare:
    """Draws the current lamps over the shaded image of each camera."""

    def __init__(self, context: moderngl.Context, library: ProgramLibrary) -> None:
        self._context = context
        self._lamps = context.buffer(reserve=_MAX_LAMPS * 12 * 4)
        self._arrays = [
            context.vertex_array(
                library.load(f"{name}.vert", f"{name}.frag"),
                [(self._lamps, "3f4 3f4 4f4 2f4/i", "in_at", "in_facing", "in_color", "in_form")],
            )
            for name in ("glare", "streak")
        ]
        self._counts = [0, 0]

    def set_lamps(self, lamps: Table, wet: bool) -> None:
        """Set the (N,) ``LAMP_DTYPE`` rows that are lit, and whether the roads are wet. The strongest come first."""
        distance2 = np.maximum(np.sum(lamps["at"].astype(np.float64) ** 2, axis=1), 25.0)
        order = np.argsort(-lamps["glare_cd"] / distance2, kind="stable")
        lamps = lamps[order[distance2[order] < _FAR_M**2]][:_MAX_LAMPS]
        rows = np.column_stack(
            [lamps[name] for name in ("at", "facing", "color", "glare_cd", "forward", "height_m")]
        ).astype(np.float32)
        if len(rows):
            self._lamps.write(rows.tobytes())
        self._counts = [len(rows), min(len(rows), _MAX_STREAKS) if wet else 0]

    def draw(self) -> None:
        """Draw over the current framebuffer; the G-buffer must be bound."""
        self._context.enable_only(moderngl.BLEND)
        self._context.blend_func = (moderngl.ONE_MINUS_DST_COLOR, moderngl.ONE)
        for array, count in zip(reversed(self._arrays), reversed(self._counts), strict=True):
            if count:
                array.render(moderngl.TRIANGLE_STRIP, vertices=4, instances=count)
        self._context.enable_only(moderngl.NOTHING)
