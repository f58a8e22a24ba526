"""Opens an OpenGL context without a display, through EGL: on a GPU if there is one, else on Mesa's llvmpipe."""

import logging
import os
from typing import Any, NamedTuple

import moderngl

from simbev_ros.config.rendering import Device
from simbev_ros.foundation.errors import RenderError
from simbev_ros.simulation.render.gl.devices import (
    INSTALL_MESA,
    TO_CPU,
    EglDevice,
    is_software,
    list_devices,
    software_request,
)

GL_VERSION = 440
_MIN_VERSION = 100
_STEERING_PREFIXES = ("MESA_", "LIBGL_", "GALLIUM_", "EGL_", "__EGL_")
"""Beginnings of the names of variables that change what a driver can do."""

_log = logging.getLogger(__name__)


class Survey(NamedTuple):
    """Whether a device can be used: the renderer's name and OpenGL version, or the reason why not."""

    device: EglDevice
    renderer: str | None
    reason: str | None


def open_context(device: Device = "auto", first_gpu: int = 0) -> moderngl.Context:
    """Open a standalone OpenGL 4.4 core context and make it current in this thread.

    Args:
        device: ``auto``: a usable GPU, else the CPU; ``cpu``: the CPU; a number: the EGL device with this index.
        first_gpu: Index, modulo their number, of the GPU that ``auto`` tries first.

    Raises:
        RenderError: EGL or the device is missing, cannot be opened, or is older than OpenGL 4.4.
    """
    devices = list_devices()
    if isinstance(device, int):
        return _open_numbered(devices, device)
    reasons = []
    for each in _candidates(devices, device, first_gpu):
        try:
            context = _open(each)
        except RenderError as error:
            reasons.append(f"EGL device {each.index} ({each.name}) {error}")
            continue
        for reason in reasons:
            _log.warning("skipped: %s", reason)
        return context
    if not any(each.software for each in devices):
        reasons.append(f"Mesa, which renders on the CPU, is not installed ({INSTALL_MESA})")
    raise RenderError(f"no usable device for rendering: {'; '.join(reasons)}")


def describe_renderer() -> str:
    """Name of the renderer that ``open_context`` chooses by default, with its OpenGL version, for messages.

    Raises:
        RenderError: See ``open_context``.
    """
    context = open_context()
    description = describe_context(context)
    context.release()
    return description


def survey_devices() -> list[Survey]:
    """Check whether each EGL device can be used, in the order of their indices.

    Raises:
        RenderError: EGL is missing or has no device.
    """
    return [_survey(device) for device in list_devices()]


def describe_context(context: moderngl.Context) -> str:
    """Renderer and OpenGL version, for messages."""
    return f"{context.info['GL_RENDERER']}, OpenGL {context.info['GL_VERSION']}"


def _survey(device: EglDevice) -> Survey:
    request = software_request()
    if request and not device.software:
        return Survey(device, None, f"is excluded by {request}")
    try:
        context = _open(device)
    except RenderError as error:
        return Survey(device, None, str(error))
    renderer = describe_context(context)
    context.release()
    return Survey(device, renderer, None)


def _candidates(devices: tuple[EglDevice, ...], device: Device, first_gpu: int) -> list[EglDevice]:
    """Devices to try, in this order: the GPUs, beginning with the given one, then the CPU."""
    gpus = [] if device == "cpu" or software_request() else [each for each in devices if not each.software]
    first = first_gpu % max(len(gpus), 1)
    return [*gpus[first:], *gpus[:first], *(each for each in devices if each.software)]


def _open_numbered(devices: tuple[EglDevice, ...], index: int) -> moderngl.Context:
    """Open the device that the user asked for, without a fallback."""
    if index >= len(devices):
        available = ", ".join(f"{each.index} ({each.name})" for each in devices)
        raise RenderError(
            f"rendering.gpus: EGL has no device {index}; it has {available}. Name one of them, or {TO_CPU}"
        )
    device = devices[index]
    if device.software:
        raise RenderError(f"rendering.gpus: EGL device {index} is not a GPU but {device.name}; {TO_CPU}")
    if request := software_request():
        raise RenderError(f"rendering.gpus asks for EGL device {index}, but {request} forbids GPUs; unset one of them")
    try:
        return _open(device)
    except RenderError as error:
        raise RenderError(f"rendering.gpus: EGL device {index} ({device.name}) {error}; or {TO_CPU}") from None


def _open(device: EglDevice) -> moderngl.Context:
    """Open a context on a device; the error messages continue the device's name."""
    try:
        context = _create(device, GL_VERSION)
    except Exception as error:  # glcontext raises bare Exception
        raise RenderError(_open_failure(device, error)) from None
    renderer = str(context.info["GL_RENDERER"])
    if is_software(renderer) and not device.software:
        context.release()
        raise RenderError(f"has no working driver: {renderer} stands in for it; install the GPU's driver")
    return context


def _open_failure(device: EglDevice, error: Exception) -> str:
    """The reason why a device could not be opened, as far as it is known."""
    if not device.is_accessible:
        return (
            f"cannot be opened: no right to use {device.file}; add the user to its group (usermod -aG render USER), "
            "or give the container the device (--device /dev/dri)"
        )
    if "not loaded" in str(error):  # raised for the libraries libEGL and libGL
        return f"cannot be opened: {error}. Install it ({INSTALL_MESA})"
    try:
        context = _create(device, _MIN_VERSION)
    except Exception:  # glcontext raises bare Exception; the first message is the better reason
        return f"cannot be opened: {error}; {_remedy()}"
    version, code = context.info["GL_VERSION"], context.version_code
    context.release()
    if code >= GL_VERSION:
        return f"cannot be opened: {error}; {_remedy()}"
    return f"has only OpenGL {version}, and 4.4 is needed; {_remedy()}"


def _remedy() -> str:
    """Advice for a driver that does not work: unset the variables that steer it, if there are any."""
    steering = [f"{name}={value}" for name, value in sorted(os.environ.items()) if name.startswith(_STEERING_PREFIXES)]
    return f"unset {' and '.join(steering)}" if steering else "update its driver"


def _create(device: EglDevice, version: int) -> moderngl.Context:
    settings: Any = {"backend": "egl", "device_index": device.index, "libegl": "libEGL.so.1", "libgl": "libGL.so.1"}
    return moderngl.create_context(version, standalone=True, **settings)
