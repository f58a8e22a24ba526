"""Opening an OpenGL context without a display, through EGL: on a GPU where there is one, else on Mesa's llvmpipe."""

import logging
import os
from typing import Any, NamedTuple

import moderngl

from simbev_ros.config.rendering import Device
from simbev_ros.errors import RenderError
from simbev_ros.render.gl.devices import INSTALL_MESA, TO_CPU, EglDevice, is_software, list_devices, software_wanted

GL_VERSION = 440
_LEAST_VERSION = 100

_log = logging.getLogger(__name__)


class Survey(NamedTuple):
    """What one device is good for: what is drawn with and its version of OpenGL, or why it cannot be used."""

    device: EglDevice
    renderer: str | None
    reason: str | None


def open_context(device: Device = "auto", turn: int = 0) -> moderngl.Context:
    """A stand-alone OpenGL 4.4 core context that is current in this thread.

    Args:
        device: A GPU if EGL has one that can be used, else the CPU (``auto``); the CPU; or the EGL device of a number.
        turn: Of the GPUs that ``auto`` may take, which to try first; counted round.

    Raises:
        RenderError: EGL or the device is missing, cannot be opened, or is older than OpenGL 4.4.
    """
    devices = list_devices()
    if isinstance(device, int):
        return _open_numbered(devices, device)
    reasons = []
    for each in _candidates(devices, device, turn):
        try:
            context = _open(each)
        except RenderError as error:
            reasons.append(f"EGL device {each.index} ({each.name}) {error}")
            continue
        for reason in reasons:
            _log.warning("passed over: %s", reason)
        return context
    if not any(each.software for each in devices):
        reasons.append(f"Mesa, which draws on the CPU, is not installed ({INSTALL_MESA})")
    raise RenderError(f"nothing here can draw: {'; '.join(reasons)}")


def describe_renderer() -> str:
    """What ``open_context`` draws with when it may choose, for people.

    Raises:
        RenderError: As ``open_context``.
    """
    context = open_context()
    description = describe_context(context)
    context.release()
    return description


def survey_devices() -> list[Survey]:
    """What each of EGL's devices is good for, in the order of their numbers.

    Raises:
        RenderError: There is no EGL, or it has no device.
    """
    return [_surveyed(device) for device in list_devices()]


def describe_context(context: moderngl.Context) -> str:
    """Renderer and OpenGL version, for people."""
    return f"{context.info['GL_RENDERER']}, OpenGL {context.info['GL_VERSION']}"


def _surveyed(device: EglDevice) -> Survey:
    wish = software_wanted()
    if wish and not device.software:
        return Survey(device, None, f"is not wanted: {wish}")
    try:
        context = _open(device)
    except RenderError as error:
        return Survey(device, None, str(error))
    renderer = describe_context(context)
    context.release()
    return Survey(device, renderer, None)


def _candidates(devices: tuple[EglDevice, ...], device: Device, turn: int) -> list[EglDevice]:
    """What to try, in this order: the GPUs, one's own first, and then the CPU."""
    gpus = [] if device == "cpu" or software_wanted() else [each for each in devices if not each.software]
    first = turn % max(len(gpus), 1)
    return [*gpus[first:], *gpus[:first], *(each for each in devices if each.software)]


def _open_numbered(devices: tuple[EglDevice, ...], index: int) -> moderngl.Context:
    """The GPU that the user has asked for, and nothing else."""
    if index >= len(devices):
        there = ", ".join(f"{each.index} ({each.name})" for each in devices)
        raise RenderError(f"rendering.gpus: EGL has no device {index}; it has {there}. Name one of them, or {TO_CPU}")
    device = devices[index]
    if device.software:
        raise RenderError(f"rendering.gpus: EGL device {index} is no GPU but {device.name}; {TO_CPU}")
    if wish := software_wanted():
        raise RenderError(f"rendering.gpus asks for EGL device {index}, but {wish} forbids GPUs; unset one of them")
    try:
        return _open(device)
    except RenderError as error:
        raise RenderError(f"rendering.gpus: EGL device {index} ({device.name}) {error}; or {TO_CPU}") from None


def _open(device: EglDevice) -> moderngl.Context:
    """A context on this device; the error's message goes on after the device's name."""
    try:
        context = _created(device, GL_VERSION)
    except Exception as error:  # glcontext raises bare Exception
        raise RenderError(_why_closed(device, error)) from None
    renderer = str(context.info["GL_RENDERER"])
    if is_software(renderer) and not device.software:
        context.release()
        raise RenderError(f"has no working driver: {renderer} stands in for it; install the GPU's driver")
    return context


def _why_closed(device: EglDevice, error: Exception) -> str:
    """Why a device could not be opened, as far as can be found out."""
    if not device.may_be_opened:
        return (
            f"cannot be opened: no right to use {device.file}; add the user to its group (usermod -aG render USER), "
            "or give the container the device (--device /dev/dri)"
        )
    if "not loaded" in str(error):  # of the libraries libEGL and libGL
        return f"cannot be opened: {error}. Install it ({INSTALL_MESA})"
    try:
        older = _created(device, _LEAST_VERSION)
    except Exception:  # glcontext raises bare Exception; what it said at first is the better reason
        return f"cannot be opened: {error}; update its driver"
    version, code = older.info["GL_VERSION"], older.version_code
    older.release()
    if code >= GL_VERSION:
        return f"cannot be opened: {error}; update its driver"
    forced = os.environ.get("MESA_GL_VERSION_OVERRIDE")
    remedy = f"unset MESA_GL_VERSION_OVERRIDE={forced}" if forced else "update its driver"
    return f"has only OpenGL {version}, and 4.4 is needed; {remedy}"


def _created(device: EglDevice, version: int) -> moderngl.Context:
    settings: Any = {"backend": "egl", "device_index": device.index, "libegl": "libEGL.so.1", "libgl": "libGL.so.1"}
    return moderngl.create_context(version, standalone=True, **settings)
