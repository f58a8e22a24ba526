"""Rain in front of the camera: streaks of falling drops, and drops on the lens.

Drops fall through a box that repeats in all directions, so that a few thousand of them fill the air around every
camera. The position of a drop depends only on its index and the time: all cameras of a frame see the same rain, and it
does not move with the camera. A streak is the path of a drop relative to the camera while the shutter is open.
"""

import moderngl
import numpy as np

from simbev_ros.config.rendering import QUALITIES
from simbev_ros.foundation.types import Float64Array
from simbev_ros.foundation.units import S_PER_NS
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.simulation.render.gl.programs import TEXTURE_UNITS, ProgramLibrary

BOX_M = np.array([20.0, 20.0, 14.0])
FALL_MPS = np.array([6.5, 7.5, 8.5, 9.5])
"""Fall speeds of drops with diameters of 1.5 to 4 mm (Gunn and Kinzer 1949)."""

_WIND_MPS = 11.0
_WIND_DIRECTION = np.array([-0.7071, -0.7071, 0.0])  # the direction of the clouds' drift
_SHUTTER_S = 1.0 / 50.0
_MAX_STREAKS = (3000, 7000, 12000)
_MAX_LENS_DROPS = 56


class Rain:
    """Draws rain over shaded images; nothing is compiled before the first rain."""

    def __init__(self, context: moderngl.Context, library: ProgramLibrary) -> None:
        self._context, self._library = context, library
        self._streaks: dict[bool, moderngl.VertexArray] = {}
        self._drops: moderngl.VertexArray | None = None
        self._weather_rain = 0.0
        self._wet = 0.0
        self._sheltered = 0.0
        self._time_s = 0.0
        self._shift_m = np.zeros((len(FALL_MPS), 3))
        self._passing_m = np.zeros((len(FALL_MPS), 3))

    def set_world(self, world: WorldState, origin_m: Float64Array, sheltered: float) -> None:
        """Set weather, time and the velocity of the cameras, which is the ego's; ``sheltered``: 1 deep in a tunnel."""
        weather, ego = world.weather, world.ego
        self._weather_rain, self._wet = weather.precipitation / 100.0, weather.wetness / 100.0
        self._sheltered = sheltered
        self._time_s = world.stamp_ns * S_PER_NS
        velocity_mps = drop_velocities(weather.wind_intensity)
        self._shift_m = np.mod(velocity_mps * self._time_s - origin_m, BOX_M)
        self._passing_m = (velocity_mps - np.array([ego["vx"], ego["vy"], ego["vz"]])) * _SHUTTER_S

    def draw_streaks(self, lamps_lit: bool) -> None:
        """Draw falling drops into the current framebuffer, the shaded image, in front of what is further away."""
        count = int(self._weather_rain * _MAX_STREAKS[QUALITIES.index(self._library.quality)])
        if not count:
            return
        if lamps_lit not in self._streaks:
            program = self._library.load("rain.vert", "rain.frag", LIT=int(lamps_lit))
            program["box"] = tuple(BOX_M)
            self._streaks[lamps_lit] = self._context.vertex_array(program, [])
        streaks = self._streaks[lamps_lit]
        _write(streaks.program, "shift", self._shift_m)
        _write(streaks.program, "passing", self._passing_m)
        self._context.enable_only(moderngl.BLEND)
        self._context.blend_func = (moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA, moderngl.ZERO, moderngl.ONE)  # type: ignore[assignment]
        streaks.render(moderngl.TRIANGLE_STRIP, vertices=4, instances=count)
        self._context.enable_only(moderngl.NOTHING)

    def draw_lens_drops(self, image: moderngl.Framebuffer, copy: moderngl.Framebuffer, camera_seed: int) -> None:
        """Draw drops on the lens over the finished image; they refract a copy of it, so they show it upside down."""
        count = int((1.0 - self._sheltered) * min(self._weather_rain, self._wet) ** 0.7 * _MAX_LENS_DROPS)
        if not count:
            return
        if self._drops is None:
            self._drops = self._context.vertex_array(self._library.load("lens_drop.vert", "lens_drop.frag"), [])
        self._context.copy_framebuffer(copy, image)
        refracted = copy.color_attachments[0]
        assert isinstance(refracted, moderngl.Texture)
        refracted.use(TEXTURE_UNITS["shaded"])
        image.use()
        program = self._drops.program
        program["time"], program["camera_seed"] = self._time_s, camera_seed & 0xFFFF
        self._context.enable_only(moderngl.BLEND)
        self._context.blend_func = (moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA)
        self._drops.render(moderngl.TRIANGLE_STRIP, vertices=4, instances=count)
        self._context.enable_only(moderngl.NOTHING)


def drop_velocities(wind_intensity: float) -> Float64Array:
    """(4, 3) velocities of slow to fast drops in the map frame, m/s, in a wind of 0..100."""
    wind_mps: Float64Array = _WIND_DIRECTION * (_WIND_MPS * wind_intensity / 100.0)
    return wind_mps - np.outer(FALL_MPS, [0.0, 0.0, 1.0])


def _write(program: moderngl.Program, name: str, values: Float64Array) -> None:
    uniform = program[name]
    assert isinstance(uniform, moderngl.Uniform)
    uniform.write(values.astype("f4").tobytes())
