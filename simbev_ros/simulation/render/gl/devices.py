"""Lists EGL's devices, and distinguishes GPUs from software renderers, without opening any of them."""

import ctypes
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from simbev_ros.foundation.errors import RenderError

TO_CPU = "set rendering.gpus: [] in the configuration, or LIBGL_ALWAYS_SOFTWARE=1, to draw on the CPU"
INSTALL_MESA = "Debian, Ubuntu: apt install libegl1 libegl-mesa0 libgl1-mesa-dri libgl1"
_REMEDY = f"Install Mesa ({INSTALL_MESA}) or the EGL part of the GPU's driver, and run `simbev doctor`"
_MAX_DEVICES = 64

_EXTENSIONS, _RENDERER, _DRM_FILE, _RENDER_NODE = 0x3055, 0x335F, 0x3233, 0x3377  # from EGL's registry
_CUDA_DEVICE = 0x323A
_SOFTWARE, _CUDA_EXTENSION = "EGL_MESA_device_software", "EGL_NV_device_cuda"
_NAMES = (
    ("EGL_EXT_device_query_name", _RENDERER),
    ("EGL_EXT_device_drm_render_node", _RENDER_NODE),
    ("EGL_EXT_device_drm", _DRM_FILE),
)
"""Extension of a device → the string that it provides, the best name first."""

_VENDOR_VARIABLES = ("__EGL_VENDOR_LIBRARY_FILENAMES", "__EGL_VENDOR_LIBRARY_DIRS")
_OFF = {"", "0", "f", "false", "n", "no", "off"}
_SOFTWARE_DRIVERS = {"llvmpipe", "softpipe", "swrast", "kms_swrast"}


@dataclass(frozen=True, slots=True)
class EglDevice:
    """An EGL device.

    Attributes:
        index: EGL's index of the device.
        name: Name given by its driver, or its device file.
        software: Whether it is Mesa's CPU renderer.
        file: Device file that a process must be allowed to open, if EGL provides it.
        cuda_index: CUDA's number of the device, if it is one of CUDA's.
    """

    index: int
    name: str
    software: bool
    file: str | None = None
    cuda_index: int | None = None

    @property
    def is_accessible(self) -> bool:
        """Whether this user may open the device file, as far as that is known."""
        return self.file is None or not Path(self.file).exists() or os.access(self.file, os.R_OK | os.W_OK)


def list_devices() -> tuple[EglDevice, ...]:
    """All devices in the order of their indices; GPUs usually come before the software renderer.

    Raises:
        RenderError: libEGL is missing, or it has no device; the message says what to install.
    """
    try:
        egl = ctypes.CDLL("libEGL.so.1")
    except OSError as error:
        raise RenderError(f"OpenGL needs EGL, which is not installed ({error}). {_REMEDY}") from None
    devices = tuple(_describe(egl, index, handle) for index, handle in enumerate(_handles(egl)))
    if not devices:
        hidden = " and ".join(f"{name}={os.environ[name]}" for name in _VENDOR_VARIABLES if os.environ.get(name))
        reason = f"it looks for drivers only where {hidden} says" if hidden else "no driver is installed"
        raise RenderError(f"EGL has no device to render on: {reason}. {_REMEDY}")
    return devices


def software_request() -> str | None:
    """The environment variable, with its value, that requests Mesa's CPU renderer; None if there is none."""
    for name in ("GALLIUM_DRIVER", "MESA_LOADER_DRIVER_OVERRIDE"):
        if os.environ.get(name, "").lower() in _SOFTWARE_DRIVERS:
            return f"{name}={os.environ[name]}"
    value = os.environ.get("LIBGL_ALWAYS_SOFTWARE", "")
    return None if value.lower() in _OFF else f"LIBGL_ALWAYS_SOFTWARE={value}"


def accessible_gpus() -> tuple[EglDevice, ...]:
    """GPUs that this user may open; a GPU appears once, even if several drivers list it.

    Raises:
        RenderError: See ``list_devices``.
    """
    gpus = [device for device in reversed(list_devices()) if not device.software and device.is_accessible]
    return tuple(sorted({gpu.file or gpu.index: gpu for gpu in gpus}.values(), key=lambda gpu: gpu.index))


def is_software(renderer: str) -> bool:
    """Whether OpenGL's name of a renderer is that of a CPU renderer."""
    words = renderer.lower()
    return any(driver in words for driver in (*_SOFTWARE_DRIVERS, "software rasterizer"))


def _handles(egl: ctypes.CDLL) -> list[int]:
    """EGL's handles of its devices."""
    query = egl_function(egl, "eglQueryDevicesEXT", ctypes.c_uint, ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p)
    handles, count = (ctypes.c_void_p * _MAX_DEVICES)(), ctypes.c_int()
    if query is None or not query(_MAX_DEVICES, ctypes.byref(handles), ctypes.byref(count)):
        return []
    return [handle or 0 for handle in handles[: count.value]]


def _describe(egl: ctypes.CDLL, index: int, handle: int) -> EglDevice:
    query = egl_function(egl, "eglQueryDeviceStringEXT", ctypes.c_char_p, ctypes.c_void_p, ctypes.c_int)

    def text(name: int) -> str:
        return ((query and query(handle, name)) or b"").decode(errors="replace")

    extensions = text(_EXTENSIONS).split()
    names = {key: text(key) for extension, key in _NAMES if extension in extensions}
    software = _SOFTWARE in extensions
    default = "Mesa's software renderer" if software else "GPU"
    name = next((value for value in names.values() if value), default)
    cuda_index = _cuda_index(egl, handle) if _CUDA_EXTENSION in extensions else None
    return EglDevice(index, name, software, names.get(_RENDER_NODE) or names.get(_DRM_FILE) or None, cuda_index)


def _cuda_index(egl: ctypes.CDLL, handle: int) -> int | None:
    """CUDA's number of a device."""
    query = egl_function(
        egl, "eglQueryDeviceAttribEXT", ctypes.c_uint, ctypes.c_void_p, ctypes.c_int, ctypes.POINTER(ctypes.c_ssize_t)
    )
    value = ctypes.c_ssize_t()
    return value.value if query is not None and query(handle, _CUDA_DEVICE, ctypes.byref(value)) else None


def egl_function(egl: ctypes.CDLL, name: str, result: Any, *arguments: Any) -> Callable[..., Any] | None:
    """A function of EGL, of its extensions or of OpenGL; None if it does not exist."""
    egl.eglGetProcAddress.restype = ctypes.c_void_p
    egl.eglGetProcAddress.argtypes = [ctypes.c_char_p]
    address = egl.eglGetProcAddress(name.encode())
    return None if address is None else ctypes.CFUNCTYPE(result, *arguments)(address)
