"""Shades the G-buffer into a color image: one shader per class, then reflections, anti-aliasing, glare, rain."""

from collections.abc import Sequence

import moderngl
import numpy as np

from simbev_ros.config.lights import MAX_COLORS
from simbev_ros.foundation.random import stream
from simbev_ros.foundation.types import Float64Array, Table
from simbev_ros.schema.scene.appearance import AppearanceSpec
from simbev_ros.schema.scene.lights import LightSpec
from simbev_ros.simulation.render.gl.programs import BLOCK_BINDINGS, TEXTURE_UNITS, ProgramLibrary
from simbev_ros.simulation.render.gl.screen_pass import ScreenPass
from simbev_ros.simulation.render.gl.targets import Targets
from simbev_ros.simulation.render.gl.timer import Timer
from simbev_ros.simulation.render.lighting.fog_glow import FogGlow
from simbev_ros.simulation.render.lighting.glare import Glare
from simbev_ros.simulation.render.shading.class_areas import create_class_areas
from simbev_ros.simulation.render.shading.rain import Rain
from simbev_ros.simulation.render.shading.spray import Spray
from simbev_ros.simulation.render.shading.surfaces import material_block, shading_classes
from simbev_ros.simulation.render.shading.wetness import Wetness

_SEED_COUNT = 4096
_GROUND = shading_classes().index("ground")
_LIGHT_BLOCK_BYTES = (11 + 3 * 4 + 3) * 16
_LIGHT_ROWS = (1, 3, 4, 5, 6, 7)
"""Rows of the block that are colors of light: first that of sun or moon, then those of air, clouds, sky and ground."""
_LIGHT_SPREAD = 0.5
"""Standard deviation of the logarithm of the light's random channels, at full strength."""


class Shading:
    """Lights the G-buffer. Light, matrices and signal states must be set per frame, before its first camera."""

    def __init__(self, context: moderngl.Context, library: ProgramLibrary, timer: Timer) -> None:
        self._context = context
        self._timer = timer
        self._visibility = library.screen_pass("visibility.frag")
        self._smooth = library.screen_pass("smooth.frag")
        self._areas = create_class_areas(context, library)
        self._passes = {
            lit: [
                self._areas.surface_pass(f"shade_{name}.frag", number, LAMPS_LIT=float(lit))
                for number, name in enumerate(shading_classes())
            ]
            for lit in (False, True)
        }
        self.glare = Glare(context, library)
        self.fog_glow = FogGlow(context, library)
        self.rain = Rain(context, library)
        self.spray = Spray(context, library)
        self.wetness = Wetness(context, self._areas, library.quality, _GROUND)
        self._antialias = library.screen_pass("antialias.frag")
        self._enlarge = library.screen_pass("enlarge.frag")
        self._materials = context.buffer(material_block())
        self._materials.bind_to_uniform_block(BLOCK_BINDINGS["Materials"])
        self._light = context.buffer(reserve=_LIGHT_BLOCK_BYTES)
        self._light.bind_to_uniform_block(BLOCK_BINDINGS["Light"])
        self._signals: moderngl.Texture | None = None
        self._lamps_lit = False
        self._library = library
        self._recolor: ScreenPass | None = None
        self.set_appearance(AppearanceSpec())

    def set_appearance(self, appearance: AppearanceSpec) -> None:
        """Set the random colors of surfaces and light."""
        rng = stream(appearance.seed, "appearance.colors")
        seed, spread = int(rng.integers(_SEED_COUNT)), _LIGHT_SPREAD * appearance.randomize
        self._tint = np.exp(spread * rng.standard_normal((2, 3)))[[0] + [1] * (len(_LIGHT_ROWS) - 1)]
        self._recolor = None
        if appearance.randomize > 0.0:
            self._recolor = self._library.screen_pass("recolor.frag", SHADING_STEP=1)
            self._recolor.program["strength"], self._recolor.program["seed"] = appearance.randomize, seed

    def set_light(
        self, lamps_lit: bool, sky: Float64Array, matrices: Sequence[Float64Array], maps: Float64Array
    ) -> None:
        """Set the uniform block ``Light``.

        Args:
            lamps_lit: Whether street lamps and windows are lit.
            sky: (11, 4) vectors from ``SkyLight.block_head``.
            matrices: (4, 4) matrices of the shadow map and of the lamp field.
            maps: (3, 4) vectors from ``TunnelMap`` and ``SkyViewMap``.
        """
        self._lamps_lit = lamps_lit
        block = np.concatenate([sky, *(matrix.T for matrix in matrices), maps])
        block[_LIGHT_ROWS, :3] *= self._tint
        self._light.write(block.astype(np.float32).tobytes())

    def set_windows(self, lights: LightSpec) -> None:
        """Set the share of windows that are lit at night, and their colors."""
        buildings = lights.buildings
        colors = [[color >> shift & 0xFF for shift in (16, 8, 0)] for color in buildings.colors]
        srgb = np.resize(np.array(colors, np.float32) / 255.0, (MAX_COLORS, 3))
        program = self._passes[True][shading_classes().index("wall")].program
        program["window_colors"].write(srgb.tobytes())  # type: ignore[union-attr]
        program["window_color_count"] = len(colors)
        program["window_share"] = buildings.share_lit if buildings.enabled else 0.0
        program["window_seed"] = lights.seed % _SEED_COUNT

    def set_signals(self, signals: Table) -> None:
        """Set the states of the (S,) ``SIGNAL_DTYPE`` rows."""
        count = max(len(signals), 1)
        if self._signals is None or self._signals.width != count:
            if self._signals is not None:
                self._signals.release()
            self._signals = self._context.texture((count, 1), 1, dtype="u1")
            self._signals.use(TEXTURE_UNITS["signal_states"])
        self._signals.write(np.resize(signals["state"], count).tobytes() if len(signals) else b"\0")

    def draw(self, targets: Targets, camera_seed: int | None) -> None:
        """Fill ``targets.rgb`` from the G-buffer, which must be bound.

        Each camera seed has other drops on the lens; None: without.
        """
        with self._timer("sun and occlusion"):
            self._visibility.draw(targets.noisy_visibility)
            self._smooth.draw(targets.visibility)
        if self._recolor:
            with self._timer("random colors"):
                self._recolor.draw(targets.rgb)  # which is drawn last
                targets.rgb_texture.use(TEXTURE_UNITS["g_color"])
        with self._timer("classes"):
            self._areas.find(targets)
        passes = list(self._passes[self._lamps_lit])
        if self.wetness.wet:
            passes[_GROUND] = self.wetness.ground_pass(self._lamps_lit)
        for name, shade in zip(shading_classes(), passes, strict=True):
            with self._timer(f"shading: {name}"):
                shade.draw(targets.surfaces)
        with self._timer("reflections"):
            self.wetness.draw_reflections(targets)
        with self._timer("final pass"):
            self._antialias.draw(targets.smoothed)
            if targets.smoothed is not targets.rgb:
                self._enlarge.draw(targets.rgb)
        with self._timer("glare, rain"):
            targets.rgb.use()
            if self._lamps_lit:
                self.fog_glow.draw(targets.rgb)
                self.glare.draw()
            self.spray.draw(self._lamps_lit)
            self.rain.draw_streaks(self._lamps_lit)
            if camera_seed is not None:
                self.rain.draw_lens_drops(targets.rgb, targets.shaded, camera_seed)
