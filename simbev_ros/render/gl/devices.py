"""The devices that EGL can draw on: which there are, and which of them are GPUs. Nothing is opened."""

import ctypes
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from simbev_ros.errors import RenderError

TO_CPU = "set rendering.gpus: [] in the configuration, or LIBGL_ALWAYS_SOFTWARE=1, to draw on the CPU"
INSTALL_MESA = "Debian, Ubuntu: apt install libegl1 libegl-mesa0 libgl1-mesa-dri libgl1"
_REMEDY = f"Install Mesa ({INSTALL_MESA}) or the EGL part of the GPU's driver, and run `simbev doctor`"
_MOST = 64

_EXTENSIONS, _RENDERER, _DRM_FILE, _RENDER_NODE = 0x3055, 0x335F, 0x3233, 0x3377  # of EGL's registry
_SOFTWARE = "EGL_MESA_device_software"
_NAMES = (
    ("EGL_EXT_device_query_name", _RENDERER),
    ("EGL_EXT_device_drm_render_node", _RENDER_NODE),
    ("EGL_EXT_device_drm", _DRM_FILE),
)
"""Extension of a device → the string that it then has, the best name first."""

_VENDOR_VARIABLES = ("__EGL_VENDOR_LIBRARY_FILENAMES", "__EGL_VENDOR_LIBRARY_DIRS")
_OFF = {"", "0", "f", "false", "n", "no", "off"}
_SOFTWARE_DRIVERS = {"llvmpipe", "softpipe", "swrast", "kms_swrast"}


@dataclass(frozen=True, slots=True)
class EglDevice:
    """A device.

    Attributes:
        index: EGL's number of it.
        name: What its driver calls it, or its file.
        software: It is Mesa's renderer on the CPU.
        file: What a process must be allowed to open, where EGL tells.
    """

    index: int
    name: str
    software: bool
    file: str | None = None

    @property
    def may_be_opened(self) -> bool:
        """Whether this user has the right to, as far as can be told."""
        return self.file is None or not Path(self.file).exists() or os.access(self.file, os.R_OK | os.W_OK)


def list_devices() -> tuple[EglDevice, ...]:
    """All devices in the order of their numbers; GPUs mostly come before the software renderer.

    Raises:
        RenderError: There is no libEGL, or it knows no device; the message says what to install.
    """
    try:
        egl = ctypes.CDLL("libEGL.so.1")
    except OSError as error:
        raise RenderError(f"OpenGL needs EGL, which is not installed ({error}). {_REMEDY}") from None
    devices = tuple(_described(egl, index, handle) for index, handle in enumerate(_handles(egl)))
    if not devices:
        hidden = " and ".join(f"{name}={os.environ[name]}" for name in _VENDOR_VARIABLES if os.environ.get(name))
        reason = f"it looks for drivers only where {hidden} says" if hidden else "no driver is installed"
        raise RenderError(f"EGL has no device to draw on: {reason}. {_REMEDY}")
    return devices


def software_wanted() -> str | None:
    """The environment variable, with its value, by which the user wants Mesa's renderer on the CPU; None: no wish."""
    for name in ("GALLIUM_DRIVER", "MESA_LOADER_DRIVER_OVERRIDE"):
        if os.environ.get(name, "").lower() in _SOFTWARE_DRIVERS:
            return f"{name}={os.environ[name]}"
    value = os.environ.get("LIBGL_ALWAYS_SOFTWARE", "")
    return None if value.lower() in _OFF else f"LIBGL_ALWAYS_SOFTWARE={value}"


def count_gpus() -> int:
    """How many GPUs there are that this user may open, each once, even if several drivers know it.

    Raises:
        RenderError: As ``list_devices``.
    """
    gpus = [device for device in list_devices() if not device.software]
    return len({gpu.file or gpu.index for gpu in gpus if gpu.may_be_opened})


def is_software(renderer: str) -> bool:
    """Whether OpenGL's name of a renderer is that of one on the CPU."""
    words = renderer.lower()
    return any(driver in words for driver in (*_SOFTWARE_DRIVERS, "software rasterizer"))


def _handles(egl: ctypes.CDLL) -> list[int]:
    """EGL's own references to its devices."""
    query = egl_function(egl, "eglQueryDevicesEXT", ctypes.c_uint, ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p)
    handles, count = (ctypes.c_void_p * _MOST)(), ctypes.c_int()
    if query is None or not query(_MOST, ctypes.byref(handles), ctypes.byref(count)):
        return []
    return [handle or 0 for handle in handles[: count.value]]


def _described(egl: ctypes.CDLL, index: int, handle: int) -> EglDevice:
    query = egl_function(egl, "eglQueryDeviceStringEXT", ctypes.c_char_p, ctypes.c_void_p, ctypes.c_int)

    def text(name: int) -> str:
        return ((query and query(handle, name)) or b"").decode(errors="replace")

    extensions = text(_EXTENSIONS).split()
    found = {number: text(number) for extension, number in _NAMES if extension in extensions}
    software = _SOFTWARE in extensions
    usual = "Mesa's software renderer" if software else "GPU"
    name = next((value for value in found.values() if value), usual)
    return EglDevice(index, name, software, found.get(_RENDER_NODE) or found.get(_DRM_FILE) or None)


def egl_function(egl: ctypes.CDLL, name: str, result: Any, *arguments: Any) -> Callable[..., Any] | None:
    """A function of EGL, of its extensions or of OpenGL; None: there is none."""
    egl.eglGetProcAddress.restype = ctypes.c_void_p
    egl.eglGetProcAddress.argtypes = [ctypes.c_char_p]
    address = egl.eglGetProcAddress(name.encode())
    return None if address is None else ctypes.CFUNCTYPE(result, *arguments)(address)
