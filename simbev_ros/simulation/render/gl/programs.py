"""GLSL programs from shaders/*.glsl, with texture units and uniform blocks bound by name in one place."""

import re
from collections.abc import Mapping
from importlib.resources import files

import moderngl

from simbev_ros.assets.materials import Material
from simbev_ros.config.rendering import QUALITIES, Quality
from simbev_ros.foundation.semantics import Tag
from simbev_ros.schema.scene.state import Behavior, Light, SignalState
from simbev_ros.simulation.render.gl.failures import compile_error
from simbev_ros.simulation.render.gl.screen_pass import ComputePass, RasterPass, ScreenPass, compute_source

_RESERVED_UNIT = 31
"""The last one of a stage, which moderngl uses itself to create and write textures."""

TEXTURE_UNITS = {
    name: unit + (unit >= _RESERVED_UNIT)
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
            "pixel_depth",
            "triangle_ids",
            "triangle_depth",
            "tunnel_map",
            "previous_depth",
            "g_motion",
            "g_light",
            "fastest",
            "slowest",
            "sky_view",
        )
    )
}
"""Sampler name → texture unit. A texture stays bound to its unit for as long as it is valid."""

_SHADING_STEPS = (2, 1, 1)
"""Per quality: pixels per texel of the shaded image (shaders/enlarge.frag.glsl)."""

_VISIBILITY_STEPS = (4, 3, 1)
"""Per quality: pixels per texel of the visibility of sky and sun (shaders/visibility.frag.glsl)."""

BLOCK_BINDINGS = {"View": 0, "Light": 1, "Materials": 2}
"""Uniform block name → binding point."""

_INCLUDE = re.compile(r'^#include "(\w+)"$', re.MULTILINE)
_ENUMS = "".join(
    f"const uint {prefix}_{member.name} = {member.value}u;\n"
    for prefix, enum in (
        ("MATERIAL", Material),
        ("TAG", Tag),
        ("LIGHT", Light),
        ("STATE", SignalState),
        ("BEHAVIOR", Behavior),
    )
    for member in enum
)


class ProgramLibrary:
    """Compiles the shader programs of a context.

    A file includes another one of shaders/include by ``#include "name"``. ``#include "enums"`` defines every
    ``Material``, ``Tag``, ``Light``, ``SignalState`` and ``Behavior`` as a constant, e.g. ``MATERIAL_ASPHALT``. The
    macro ``QUALITY`` is 0 (low), 1 (medium) or 2 (high); ``SHADING_STEP`` and ``VISIBILITY_STEP`` depend on it.
    ``TUNNELS`` is 1 if the map has tunnels, else 0.
    """

    def __init__(
        self,
        context: moderngl.Context,
        quality: Quality = "medium",
        *,
        use_compute: bool = False,
        tunnels: bool = False,
    ) -> None:
        """Select the quality; ``use_compute``: run screen passes as compute shaders; ``tunnels``: the map has some."""
        self._context = context
        self._tunnels = int(tunnels)
        self.quality = quality
        self.use_compute = use_compute
        self._folder = files("simbev_ros.simulation.render").joinpath("shaders")

    def load(self, vertex: str, fragment: str, geometry: str | None = None, **constants: float) -> moderngl.Program:
        """Compile a program of two or three shaders, named without ``.glsl``, with ``constants`` as macros.

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
            raise compile_error(self._context, f"shaders {vertex}, {fragment}", error) from None
        _bind_names(program)
        return program

    def screen_pass(self, fragment: str, condition: str = "true", **constants: float) -> ScreenPass:
        """Compile a fragment shader that runs on every pixel.

        Args:
            fragment: Name of the shader, without ``.glsl``.
            condition: GLSL expression; where it is false, a compute shader leaves pixels unchanged.
            constants: Macros.

        Raises:
            RenderError: The driver does not compile it.
        """
        if not self.use_compute:
            return self.raster_pass(fragment, **constants)
        try:
            program = self._context.compute_shader(compute_source(self._source(fragment, constants), condition))
        except moderngl.Error as error:
            raise compile_error(self._context, f"shader {fragment}", error) from None
        _bind_names(program)
        return ComputePass(self._context, program)

    def raster_pass(self, fragment: str, **constants: float) -> RasterPass:
        """Compile a fragment shader that runs on every pixel that passes the depth test."""
        return RasterPass(self._context, self.load("screen", fragment, None, **constants))

    def _source(self, name: str, constants: Mapping[str, float]) -> str:
        """Source of a file with its includes expanded, each once, and the macros inserted after the version line."""
        included: set[str] = set()

        def expand(match: re.Match[str]) -> str:
            name = match[1]
            if name in included:
                return ""
            included.add(name)
            return _ENUMS if name == "enums" else _INCLUDE.sub(expand, self._read(f"include/{name}"))

        version, body = self._read(name).split("\n", 1)
        common = {"QUALITY": QUALITIES.index(self.quality), "TUNNELS": self._tunnels}
        constants = {**common, **quality_steps(self.quality), **constants}
        macros = [f"#define {name} {value}" for name, value in constants.items()]
        return "\n".join([version, *macros, _INCLUDE.sub(expand, body)])

    def _read(self, name: str) -> str:
        return self._folder.joinpath(f"{name}.glsl").read_text(encoding="utf-8")


def quality_steps(quality: Quality) -> dict[str, int]:
    """The macros ``SHADING_STEP`` and ``VISIBILITY_STEP`` of a quality."""
    level = QUALITIES.index(quality)
    return {"SHADING_STEP": _SHADING_STEPS[level], "VISIBILITY_STEP": _VISIBILITY_STEPS[level]}


def _bind_names(program: moderngl.Program | moderngl.ComputeShader) -> None:
    """Bind uniform blocks and samplers by their names."""
    for name in program:
        member = program[name]
        if isinstance(member, moderngl.UniformBlock):
            member.binding = BLOCK_BINDINGS[name]
        elif name in TEXTURE_UNITS and isinstance(member, moderngl.Uniform):
            member.value = TEXTURE_UNITS[name]
