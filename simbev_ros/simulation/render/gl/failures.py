"""Turns failures of OpenGL drivers into errors that say what to do."""

from collections.abc import Iterator
from contextlib import contextmanager

import moderngl

from simbev_ros.foundation.errors import RenderError
from simbev_ros.simulation.render.gl.context import describe_context
from simbev_ros.simulation.render.gl.devices import TO_CPU

_MEMORY_REMEDY = (
    "Lower width_px and height_px of the cameras, rendering.processes or rendering.quality, "
    "or end other programs that use this memory"
)


@contextmanager
def check_memory(context: moderngl.Context, purpose: str, size_bytes: int | None = None) -> Iterator[None]:
    """Check that everything allocated in this context fits into memory; OpenGL itself reports nothing, or fails later.

    Args:
        context: Current context.
        purpose: What the memory is for.
        size_bytes: The required size, if it is known.

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
        raise RenderError(
            f"{renderer} does not have enough memory left for {purpose}{size}. {_MEMORY_REMEDY}"
        ) from None
    if failure is not None:
        raise failure


def compile_error(context: moderngl.Context, shaders: str, error: moderngl.Error) -> RenderError:
    """The error for shaders that a driver does not compile."""
    driver_log = "\n".join(f"  {line}" for line in str(error).splitlines() if line.strip())
    return RenderError(
        f"the driver does not compile {shaders}: {describe_context(context)} of {context.info['GL_VENDOR']}. "
        f"Update the driver, or {TO_CPU}; please report this with the driver's messages:\n{driver_log}"
    )
