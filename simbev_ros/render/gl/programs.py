"""GLSL programs from shaders/*.glsl, with texture units and uniform blocks wired by name, once, for all of them."""

import re
from collections.abc import Mapping
from importlib.resources import files

import moderngl

from simbev_ros.assets.materials import Material
from simbev_ros.config.rendering import QUALITIES, Quality
from simbev_ros.render.gl.failures import not_compiled
from simbev_ros.render.gl.screen_pass import ComputedPass, DrawnPass, ScreenPass, compute_source
from simbev_ros.scene.state import Light, SignalState
from simbev_ros.semantics import Tag

TEXTURE_UNITS = {
    name: unit
    for unit, name in enumerate(
        (
            "g_surface",
            "g_depth",
            "g_color",
            "rigid_poses",
            "rigid_actors",
            "signal_states",
            "street_lamps",
            "shadow_map",
            "noise",
            "street_field",
            "beam_field",
            "glow_field",
            "beam_free",
            "contact_map",
            "noisy_visibility",
            "visibility",
            "shaded",
            "coarse_shaded",
            "coarse_rgb",
            "sky_table",
            "sky_dome",
            "g_slope",
            "g_edges",
            "lens_rays",
            "ideal_rgb",
            "triangle_ids",
            "triangle_depth",
        )
    )
}
"""Sampler name → texture unit. A texture is bound to its unit for as long as it is valid."""

_SHADING_STEPS = (2, 1, 1)
"""Of each quality: pixels from texel to texel of the shaded image (shaders/enlarge.frag.glsl)."""

_VISIBILITY_STEPS = (4, 3, 1)
"""Of each quality: pixels from texel to texel of the visibility of sky and sun (shaders/visibility.frag.glsl)."""

BLOCK_BINDINGS = {"View": 0, "Light": 1, "Materials": 2}
"""Uniform block name → binding point."""

_INCLUDE = re.compile(r'^#include "(\w+)"$', re.MULTILINE)
_ENUMS = "".join(
    f"const uint {prefix}_{member.name} = {member.value}u;\n"
    for prefix, enum in {"MATERIAL": Material, "TAG": Tag, "LIGHT": Light, "STATE": SignalState}.items()
    for member in enum
)


class ProgramLibrary:
    """Compiles programs.

    A file includes another of shaders/include by ``#include "name"``. ``#include "enums"`` gives every ``Material``,
    ``Tag``, ``Light`` and ``SignalState`` as a constant, e.g. ``MATERIAL_ASPHALT``. The macro ``QUALITY`` is 0 (low),
    1 (medium) or 2 (high); ``SHADING_STEP`` and ``VISIBILITY_STEP`` belong to it.
    """

    def __init__(self, context: moderngl.Context, quality: Quality = "medium", *, computes: bool = False) -> None:
        """Compile for a quality; ``computes``: run screen passes as compute shaders."""
        self._context = context
        self.quality = quality
        self.computes = computes
        self._folder = files("simbev_ros.render").joinpath("shaders")

    def load(self, vertex: str, fragment: str, geometry: str | None = None, **constants: float) -> moderngl.Program:
        """The program of two or three shaders, named without ``.glsl``, with macros for the ``constants``.

        Raises:
            RenderError: The driver does not compile it.
        """
        try:
            program = self._context.program(
                vertex_shader=self._source(vertex, constants),
                fragment_shader=self._source(fragment, constants),
                geometry_shader=None if geometry is None else self._source(geometry, constants),
            )
        except moderngl.Error as error:
            raise not_compiled(self._context, f"shaders {vertex}, {fragment}", error) from None
        _wire(program)
        return program

    def screen_pass(self, fragment: str, condition: str = "true", **constants: float) -> ScreenPass:
        """A fragment shader to be run on every pixel.

        Args:
            fragment: Its name, without ``.glsl``.
            condition: GLSL; where it does not hold, a compute shader leaves pixels as they are.
            constants: Macros.

        Raises:
            RenderError: The driver does not compile it.
        """
        if not self.computes:
            return self.drawn_pass(fragment, **constants)
        try:
            program = self._context.compute_shader(compute_source(self._source(fragment, constants), condition))
        except moderngl.Error as error:
            raise not_compiled(self._context, f"shader {fragment}", error) from None
        _wire(program)
        return ComputedPass(self._context, program)

    def drawn_pass(self, fragment: str, **constants: float) -> DrawnPass:
        """A fragment shader to be run on every pixel that passes the depth test."""
        return DrawnPass(self._context, self.load("screen", fragment, None, **constants))

    def _source(self, name: str, constants: Mapping[str, float]) -> str:
        """The file with its includes put in, each once, and macros after its first line, the version."""
        included: set[str] = set()

        def expanded(match: re.Match[str]) -> str:
            name = match[1]
            if name in included:
                return ""
            included.add(name)
            return _ENUMS if name == "enums" else _INCLUDE.sub(expanded, self._read(f"include/{name}"))

        version, body = self._read(name).split("\n", 1)
        constants = {"QUALITY": QUALITIES.index(self.quality), **steps_of(self.quality), **constants}
        macros = [f"#define {name} {value}" for name, value in constants.items()]
        return "\n".join([version, *macros, _INCLUDE.sub(expanded, body)])

    def _read(self, name: str) -> str:
        return self._folder.joinpath(f"{name}.glsl").read_text(encoding="utf-8")


def steps_of(quality: Quality) -> dict[str, int]:
    """The macros ``SHADING_STEP`` and ``VISIBILITY_STEP``."""
    level = QUALITIES.index(quality)
    return {"SHADING_STEP": _SHADING_STEPS[level], "VISIBILITY_STEP": _VISIBILITY_STEPS[level]}


def _wire(program: moderngl.Program | moderngl.ComputeShader) -> None:
    """Connect uniform blocks and samplers by their names."""
    for name in program:
        member = program[name]
        if isinstance(member, moderngl.UniformBlock):
            member.binding = BLOCK_BINDINGS[name]
        elif name in TEXTURE_UNITS and isinstance(member, moderngl.Uniform):
            member.value = TEXTURE_UNITS[name]
