"""CUDA's numbers of EGL's devices, by which Ray assigns devices to a worker."""

import ctypes
from collections.abc import Callable
from typing import Any

import pytest

from simbev_ros.simulation.render.gl import devices
from simbev_ros.simulation.render.gl.devices import EglDevice

Query = Callable[[int, int, Any], bool]


@pytest.fixture
def describe(monkeypatch: pytest.MonkeyPatch) -> Callable[[str, Query | None], EglDevice]:
    """Function that describes a device with some extensions; a given function returns EGL's number for it."""

    def describe(extensions: str, query: Query | None) -> EglDevice:
        functions = {"eglQueryDeviceStringEXT": lambda handle, name: extensions.encode()}
        monkeypatch.setattr(
            devices, "egl_function", lambda egl, name, *_: {**functions, "eglQueryDeviceAttribEXT": query}[name]
        )
        return devices._describe(ctypes.CDLL(None), 0, 7)

    return describe


def test_a_device_of_cuda_has_its_number(describe: Callable[[str, Query], EglDevice]) -> None:
    def query(handle: int, attribute: int, value: Any) -> bool:
        assert (handle, attribute) == (7, 0x323A)
        value._obj.value = 3
        return True

    assert describe("EGL_EXT_device_drm EGL_NV_device_cuda", query).cuda_index == 3


def test_a_device_that_cuda_does_not_know_has_none(describe: Callable[[str, Query], EglDevice]) -> None:
    def query(handle: int, attribute: int, value: Any) -> bool:
        raise AssertionError("it must not be asked")

    assert describe("EGL_EXT_device_drm", query).cuda_index is None


@pytest.mark.parametrize("query", [None, lambda *_: False], ids=["function is missing", "it fails"])
def test_a_driver_that_does_not_tell_the_number_leaves_it_open(
    describe: Callable[[str, Query | None], EglDevice], query: Query | None
) -> None:
    assert describe("EGL_NV_device_cuda", query).cuda_index is None
