"""Pools of light of street lamps and headlamps, as a map seen from above around the ego.

Each texel holds the light that arrives there near the ground: its mean horizontal direction, its strength and the
height of the lamps it comes from. So a pixel's cost does not grow with the number of lamps.
"""

from collections.abc import Sequence

import moderngl
import numpy as np

from simbev_ros.assets.static_scene import StreetLight
from simbev_ros.render.programs import TEXTURE_UNITS, ProgramLibrary
from simbev_ros.scene.lights import USUAL_LM, LightSpec, street_lights
from simbev_ros.scene.state import Light, WorldState
from simbev_ros.types import Float32Array, Float64Array

_SIZE_PX = 512
_HALF_M = 160.0
_REACH_M = 84.0  # of a high beam
_MAX_LAMPS = 1024  # more than any street has within reach of the map
_HEADLAMP_HEIGHT_M = 0.7
_LAMPS_PER_LINE = 128  # of a texture; shaders/shade_lamp.frag.glsl


class LampField:
    """Two maps: street lamps and headlamps, which differ in colour and direction."""

    def __init__(
        self, context: moderngl.Context, library: ProgramLibrary, street_lights: Sequence[StreetLight]
    ) -> None:
        self._context = context
        self._lights_m = np.array([light.position_m for light in street_lights], np.float64).reshape(-1, 3)
        self._lamps = context.buffer(reserve=_MAX_LAMPS * 28)
        program = library.load("lamp_pool.vert", "lamp_pool.frag")
        program["half_m"] = _HALF_M
        self._pools = context.vertex_array(
            program, [(self._lamps, "3f4 2f4 1f4 1f4/i", "in_lamp", "in_heading", "in_kind", "in_strength")]
        )
        self._strengths = np.ones(len(self._lights_m))
        lines = -(-max(len(self._lights_m), 1) // _LAMPS_PER_LINE)
        self._glow = context.texture((_LAMPS_PER_LINE, lines), 1, dtype="f4")
        self._glow.use(TEXTURE_UNITS["street_lamps"])
        self._street, self._head = (self._field(name) for name in ("street_field", "head_field"))

    def set_lights(self, lights: LightSpec) -> None:
        """Set how strongly each street light shines when it is dark."""
        table = street_lights(lights, self._lights_m)
        self._strengths = np.where(table["on"], table["intensity_lm"] / USUAL_LM, 0.0)
        glow = np.zeros((self._glow.height, self._glow.width), np.float32)
        glow.flat[: len(table)] = self._strengths
        self._glow.write(glow.tobytes())

    def draw(self, world: WorldState, origin_m: Float64Array, lit: bool) -> Float64Array:
        """Draw both maps; while lamps are not lit no shader reads them.

        Returns:
            (4, 4) texture coordinates from world points.
        """
        if lit:
            self._context.enable_only(moderngl.BLEND)
            self._context.blend_func = (moderngl.ONE, moderngl.ONE)
            self._draw_lamps(self._street, self._street_lamps(origin_m))
            self._draw_lamps(self._head, _headlamps(world, origin_m))
        texture_from_world = np.diag([0.5 / _HALF_M, 0.5 / _HALF_M, 0.0, 1.0])
        texture_from_world[:2, 3] = 0.5
        return texture_from_world

    def _field(self, name: str) -> moderngl.Framebuffer:
        """A map, bound to the texture unit of its name."""
        texture = self._context.texture((_SIZE_PX, _SIZE_PX), 4, dtype="f2")
        texture.repeat_x = texture.repeat_y = False
        texture.use(TEXTURE_UNITS[name])
        return self._context.framebuffer([texture])

    def _draw_lamps(self, field: moderngl.Framebuffer, lamps: Float32Array) -> None:
        """Add up the light of (N, 7) lamps."""
        field.use()
        field.clear()
        count = min(len(lamps), _MAX_LAMPS)
        if count:
            self._lamps.write(lamps[:count].tobytes())
            self._pools.render(moderngl.TRIANGLE_STRIP, vertices=4, instances=count)

    def _street_lamps(self, origin_m: Float64Array) -> Float32Array:
        """(N, 7) lamps that shine in reach of the map: position, heading (none), kind 0, strength."""
        lights_m = self._lights_m - origin_m
        near = (np.abs(lights_m[:, :2]) < _HALF_M + _REACH_M).all(axis=1) & (self._strengths > 0.0)
        lamps: Float32Array = np.pad(lights_m[near], ((0, 0), (0, 4))).astype(np.float32)
        lamps[:, 6] = self._strengths[near]
        return lamps


def _headlamps(world: WorldState, origin_m: Float64Array) -> Float32Array:
    """(N, 7) pairs of headlamps: position between them, heading, kind 1 (2 on high beam), strength 1."""
    actors = world.actors[(world.actors["lights"] & (Light.LOW_BEAM | Light.HIGH_BEAM)) != 0]
    heading = np.stack([np.cos(actors["yaw"]), np.sin(actors["yaw"])], axis=1)
    front = np.stack([actors["x"], actors["y"]], axis=1) + heading * actors["length"][:, None] / 2.0 - origin_m[:2]
    high = (actors["lights"] & Light.HIGH_BEAM) != 0
    lamps = np.column_stack(
        [front, actors["z"] - origin_m[2] + _HEADLAMP_HEIGHT_M, heading, 1.0 + high, np.ones(len(front))]
    )
    near: Float32Array = lamps[np.abs(front).max(axis=1, initial=0.0) < _HALF_M + _REACH_M].astype(np.float32)
    return near
