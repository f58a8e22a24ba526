"""What drivers refuse, in words that say what to do."""

from collections.abc import Iterator
from contextlib import contextmanager

import moderngl

from simbev_ros.errors import RenderError
from simbev_ros.render.gl.context import describe_context
from simbev_ros.render.gl.devices import TO_CPU

_LESS = (
    "Lower width_px and height_px of the cameras, rendering.processes or rendering.quality, "
    "or end other programs that use this memory"
)


@contextmanager
def enough_memory(context: moderngl.Context, purpose: str, size_bytes: int | None = None) -> Iterator[None]:
    """Whatever is allocated within must be there in the end: OpenGL itself says nothing, or something else fails.

    Args:
        context: Current context.
        purpose: What the memory is for.
        size_bytes: How much it is, if that is known.

    Raises:
        RenderError: Memory ran out.
    """
    failure: moderngl.Error | None = None
    try:
        yield
    except moderngl.Error as error:
        failure = error
    if context.error == "GL_OUT_OF_MEMORY":
        size = "" if size_bytes is None else f" (about {size_bytes / 2**20:.0f} MiB)"
        renderer = context.info["GL_RENDERER"]
        raise RenderError(f"{renderer} has not enough memory left for {purpose}{size}. {_LESS}") from None
    if failure is not None:
        raise failure


def not_compiled(context: moderngl.Context, shaders: str, error: moderngl.Error) -> RenderError:
    """The error for shaders that a driver does not take."""
    said = "\n".join(f"  {line}" for line in str(error).splitlines() if line.strip())
    return RenderError(
        f"the driver does not compile {shaders}: {describe_context(context)} of {context.info['GL_VENDOR']}. "
        f"Update the driver, or {TO_CPU}; please report it with what the driver says:\n{said}"
    )
