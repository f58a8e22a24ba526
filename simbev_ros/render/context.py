"""Opening an OpenGL context without a display, through EGL: on a GPU where EGL finds one, else on Mesa's llvmpipe."""

from typing import Any

import moderngl

from simbev_ros.errors import RenderError

GL_VERSION = 330
_REMEDY = (
    "Install Mesa's EGL (Debian, Ubuntu: apt install libegl1 libegl-mesa0 libgl1-mesa-dri libgl1), "
    "or the EGL part of the GPU's driver, and run `simbev doctor`."
)


def open_context(device_index: int = 0) -> moderngl.Context:
    """A stand-alone OpenGL 3.3 core context that is current in this thread.

    Args:
        device_index: Which of EGL's devices. EGL lists GPUs before the software renderer.

    Raises:
        RenderError: EGL or the device is missing, or is older than OpenGL 3.3.
    """
    settings: Any = {"backend": "egl", "device_index": device_index}
    try:
        return moderngl.create_context(GL_VERSION, standalone=True, **settings)
    except Exception as error:  # glcontext raises bare Exception
        raise RenderError(f"no OpenGL 3.3 context on EGL device {device_index}: {error}. {_REMEDY}") from error


def describe_renderer() -> str:
    """Renderer and OpenGL version of the context that would be used, for people.

    Raises:
        RenderError: As ``open_context``.
    """
    context = open_context()
    description = f"{context.info['GL_RENDERER']}, OpenGL {context.info['GL_VERSION']}"
    context.release()
    return description
