"""Shaders that run on every pixel of an image: rasterized as a triangle on the CPU, as compute shaders on a GPU.

They are written as fragment shaders; for GPUs, ``compute_source`` rewrites them as compute shaders. Data center GPUs
run fragment shaders on few of their cores (NVIDIA H100: on 2 of its 66 TPCs), but compute shaders on all of them.
"""

import re
from typing import Protocol

import moderngl

_GROUP_PX = 8
_VERSION = "#version 430"
_IMAGES = {
    "float": ("image2D", "vec4({})"),
    "vec2": ("image2D", "vec4({}, 0.0, 0.0)"),
    "vec4": ("image2D", "{}"),
    "uint": ("uimage2D", "uvec4({})"),
    "uvec4": ("uimage2D", "{}"),
}
"""Type of an output → the image type that it is stored in, and the texel to store."""

_OUTPUT = re.compile(r"^(?:layout\(location = (\d+)\) )?out (\w+) (\w+);", re.MULTILINE)
_MAIN = "void main()"


class ScreenPass(Protocol):
    """A shader that runs on every pixel of a framebuffer, or on the subset that it was created for."""

    @property
    def program(self) -> moderngl.Program | moderngl.ComputeShader:
        """The program, for setting its uniforms."""
        ...

    def draw(self, target: moderngl.Framebuffer) -> None:
        """Run the shader on a framebuffer. All later passes can read the result."""
        ...


class RasterPass:
    """Draws one triangle that covers the screen. The framebuffer stays in use."""

    def __init__(self, context: moderngl.Context, program: moderngl.Program) -> None:
        """Wrap a program with the vertex shader shaders/screen.glsl."""
        self.program = program
        self._triangle = context.vertex_array(program, [])

    def draw(self, target: moderngl.Framebuffer, layer: float = 1.0) -> None:
        """Run it where the depth test, if enabled, lets a depth of 0 (near) … 1 (far) pass."""
        target.use()
        self.program["layer"] = layer
        self._triangle.render(moderngl.TRIANGLES, vertices=3)


class ComputePass:
    """Runs a compute shader from ``compute_source``."""

    def __init__(self, context: moderngl.Context, program: moderngl.ComputeShader) -> None:
        self.program = program
        self._context = context

    def draw(self, target: moderngl.Framebuffer) -> None:
        """Run it on the framebuffer's color attachments, which are its outputs in their order."""
        for unit, texture in enumerate(target.color_attachments):
            assert isinstance(texture, moderngl.Texture)
            texture.bind_to_image(unit, read=False, write=True)
        width_px, height_px = target.size
        self.program.run(-(-width_px // _GROUP_PX), -(-height_px // _GROUP_PX))
        self._context.memory_barrier()


def compute_source(fragment: str, condition: str) -> str:
    """Rewrite a fragment shader as a compute shader that does the same per pixel where a GLSL condition is true.

    The macro ``COMPUTED`` is defined; derivatives such as dFdx are not available. Every output in the text counts, so
    none may be inside a preprocessor condition.
    """
    stores: list[str] = []

    def image(match: re.Match[str]) -> str:
        unit, kind, name = match[1] or "0", match[2], match[3]
        image_type, texel = _IMAGES[kind]
        stores.append(f"    imageStore(image_of_{name}, pixel, {texel.format(name)});")
        return f"layout(binding = {unit}) writeonly uniform {image_type} image_of_{name};\n{kind} {name};"

    body = fragment.split("\n", 1)[1].replace("gl_FragCoord", "frag_coord").replace(_MAIN, "void draw_pixel()")
    body = _OUTPUT.sub(image, body)
    first_image = re.search(r"image_of_\w+", body)
    assert first_image is not None, "a screen pass without an output"
    return "\n".join(
        [
            _VERSION,
            "#define COMPUTED",
            f"layout(local_size_x = {_GROUP_PX}, local_size_y = {_GROUP_PX}) in;",
            "vec4 frag_coord;",
            body,
            f"{_MAIN} {{",
            "    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);",
            f"    if (any(greaterThanEqual(pixel, imageSize({first_image[0]})))) return;",
            "    frag_coord = vec4(vec2(pixel) + 0.5, 0.0, 1.0);",
            f"    if (!({condition})) return;",
            "    draw_pixel();",
            *stores,
            "}",
        ]
    )
