"""Buffers in CPU memory that a GPU writes to, and fences that show when it has finished; moderngl offers neither."""

import ctypes
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import moderngl
import numpy as np

from simbev_ros.foundation.types import UInt8Array
from simbev_ros.simulation.render.gl.devices import egl_function

_PIXEL_PACK_BUFFER = 0x88EB
_MAP_READ, _MAP_PERSISTENT, _MAP_COHERENT, _CLIENT_STORAGE = 0x1, 0x40, 0x80, 0x200
_GPU_COMMANDS_COMPLETE, _FLUSH_COMMANDS = 0x9117, 0x1
_TIMEOUT_EXPIRED = 0x911B
_POLL_NS = 10_000_000_000


class PinnedBuffer:
    """A pixel pack buffer that stays mapped (ARB_buffer_storage, OpenGL 4.4).

    Attributes:
        buffer: Argument for moderngl's functions that read pixels.
        content: (N,) the bytes in it; valid after a ``Fence`` created after the reading has been passed.
    """

    def __init__(self, context: moderngl.Context, size_bytes: int) -> None:
        """Allocate the buffer; the context must be current."""
        self.buffer = context.buffer(reserve=size_bytes)
        flags = _MAP_READ | _MAP_PERSISTENT | _MAP_COHERENT
        bind = _function("glBindBuffer", None, ctypes.c_uint, ctypes.c_uint)
        bind(_PIXEL_PACK_BUFFER, self.buffer.glo)
        size = ctypes.c_ssize_t
        store = _function("glBufferStorage", None, ctypes.c_uint, size, ctypes.c_void_p, ctypes.c_uint)
        store(_PIXEL_PACK_BUFFER, size_bytes, None, flags | _CLIENT_STORAGE)
        map_range = _function("glMapBufferRange", ctypes.c_void_p, ctypes.c_uint, size, size, ctypes.c_uint)
        address = map_range(_PIXEL_PACK_BUFFER, 0, size_bytes, flags)
        bind(_PIXEL_PACK_BUFFER, 0)
        if not address:
            raise moderngl.Error(f"cannot map a buffer of {size_bytes} bytes that the GPU and the CPU share")
        self.content: UInt8Array = np.ctypeslib.as_array(
            ctypes.cast(address, ctypes.POINTER(ctypes.c_uint8)), (size_bytes,)
        )


class Fence:
    """Marks the current position in the OpenGL command stream."""

    def __init__(self) -> None:
        create = _function("glFenceSync", ctypes.c_void_p, ctypes.c_uint, ctypes.c_uint)
        self._sync = create(_GPU_COMMANDS_COMPLETE, 0)

    def is_passed(self) -> bool:
        """Whether the GPU has finished all earlier commands; must not be called again once it has returned True."""
        return self._poll(0)

    def wait(self) -> bool:
        """Wait until the GPU has finished all earlier commands. Always True."""
        while not self._poll(_POLL_NS):
            pass
        return True

    def _poll(self, timeout_ns: int) -> bool:
        wait = _function("glClientWaitSync", ctypes.c_uint, ctypes.c_void_p, ctypes.c_uint, ctypes.c_uint64)
        if wait(self._sync, _FLUSH_COMMANDS, timeout_ns) == _TIMEOUT_EXPIRED:
            return False
        _function("glDeleteSync", None, ctypes.c_void_p)(self._sync)
        return True


@lru_cache(maxsize=16)
def _function(name: str, result: Any, *arguments: Any) -> Callable[..., Any]:
    """Look up a function of OpenGL."""
    function = egl_function(ctypes.CDLL("libEGL.so.1"), name, result, *arguments)
    assert function is not None, f"OpenGL 4.4 without {name}"
    return function
