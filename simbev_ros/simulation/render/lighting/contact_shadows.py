"""Contact shadows: a map around the ego, seen from above, of where actors block the sky's light from the ground.

Drawn once per frame from the actors table; the visibility shader reads it.
"""

import moderngl
import numpy as np

from simbev_ros.foundation.types import Float64Array
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.simulation.render.gl.programs import TEXTURE_UNITS, ProgramLibrary

HALF_M = 48.0
"""Half the map's width; further away the dark seam under a car is thinner than a pixel."""

_SIZE_PX = 768
_MAX_ACTORS = 1024


class ContactMap:
    """Map of actor footprints with soft edges, and the height of the ground below them."""

    def __init__(self, context: moderngl.Context, library: ProgramLibrary) -> None:
        self._context = context
        self._actors = context.buffer(reserve=_MAX_ACTORS * 28)
        program = library.load("footprint.vert", "footprint.frag")
        program["half_m"] = HALF_M
        self._footprints = context.vertex_array(
            program, [(self._actors, "3f4 2f4 2f4/i", "in_place", "in_heading", "in_half_size")]
        )
        texture = context.texture((_SIZE_PX, _SIZE_PX), 2, dtype="f2")
        texture.repeat_x = texture.repeat_y = False
        texture.use(TEXTURE_UNITS["contact_map"])
        self._framebuffer = context.framebuffer([texture])

    def draw(self, world: WorldState, origin_m: Float64Array) -> None:
        """Draw the map of a world around (3,) ``origin_m``."""
        actors = world.actors
        position_m = np.stack([actors["x"], actors["y"], actors["z"]], axis=1) - origin_m
        heading = np.stack([np.cos(actors["yaw"]), np.sin(actors["yaw"])], axis=1)
        half_size_m = np.stack([actors["length"], actors["width"]], axis=1) / 2.0
        near = np.abs(position_m[:, :2]).max(axis=1, initial=0.0) < HALF_M * 1.2
        rows = np.concatenate([position_m, heading, half_size_m], axis=1)[near][:_MAX_ACTORS]
        self._context.enable_only(moderngl.BLEND)
        self._context.blend_func = (moderngl.ONE, moderngl.ONE)
        self._framebuffer.use()
        self._framebuffer.clear()
        if len(rows):
            self._actors.write(rows.astype(np.float32).tobytes())
            self._footprints.render(moderngl.TRIANGLE_STRIP, vertices=4, instances=len(rows))
