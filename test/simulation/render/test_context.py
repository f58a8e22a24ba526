"""Choice of the rendering device and its errors: with mock devices, and with a real EGL broken on purpose."""

import ctypes
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import moderngl
import pytest

from simbev_ros.foundation.errors import RenderError
from simbev_ros.simulation.render.gl import context as module
from simbev_ros.simulation.render.gl.context import describe_renderer, open_context, survey_devices
from simbev_ros.simulation.render.gl.devices import EglDevice, list_devices
from simbev_ros.simulation.render.gl.failures import check_memory
from simbev_ros.simulation.render.gl.programs import ProgramLibrary

pytestmark = pytest.mark.gl

GPUS = (EglDevice(0, "NVIDIA H200", software=False), EglDevice(1, "NVIDIA H200", software=False))
MESA = EglDevice(2, "Mesa's software renderer", software=True)


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Mock this machine's devices: a list, and by index their failures or the renderer names that OpenGL reports."""
    for name in ("LIBGL_ALWAYS_SOFTWARE", "GALLIUM_DRIVER", "MESA_LOADER_DRIVER_OVERRIDE"):
        monkeypatch.delenv(name, raising=False)

    def build(
        *devices: EglDevice, failures: dict[int, str] | None = None, renderer_names: dict[int, str] | None = None
    ) -> None:
        def create(device: EglDevice, version: int) -> Any:
            if device.index in (failures or {}):
                raise Exception(failures[device.index])  # type: ignore[index]  # like glcontext
            name = (
                "llvmpipe (LLVM 15)"
                if device.software
                else (renderer_names or {}).get(device.index, "NVIDIA H200/PCIe")
            )
            info = {"GL_RENDERER": name, "GL_VERSION": "4.6"}
            return SimpleNamespace(index=device.index, info=info, version_code=460, release=lambda: None)

        monkeypatch.setattr(module, "list_devices", lambda: devices)
        monkeypatch.setattr(module, "_create", create)

    return build


def opened_index(*arguments: Any) -> int:
    return open_context(*arguments).index  # type: ignore[attr-defined,no-any-return]


def test_processes_use_the_gpus_in_turn_or_the_cpu_on_request(machine: Any) -> None:
    machine(*GPUS, MESA)
    assert [opened_index("auto", first_gpu) for first_gpu in range(4)] == [0, 1, 0, 1]
    assert (opened_index(1, 4), opened_index("cpu")) == (1, 2)


def test_without_a_gpu_the_cpu_renders(machine: Any) -> None:
    machine(MESA)
    assert [opened_index("auto", first_gpu) for first_gpu in range(2)] == [2, 2]


def test_a_gpu_without_access_or_driver_is_skipped_and_the_survey_says_why(
    machine: Any, caplog: pytest.LogCaptureFixture
) -> None:
    machine(*GPUS, MESA, failures={0: "eglInitialize failed (0x3001)"}, renderer_names={1: "llvmpipe (LLVM 15)"})
    assert opened_index("auto", 1) == 2
    assert "EGL device 0 (NVIDIA H200) cannot be opened: eglInitialize failed (0x3001)" in caplog.text
    reasons = [survey.reason for survey in survey_devices()]
    assert reasons[0] == "cannot be opened: eglInitialize failed (0x3001); update its driver"
    assert reasons[1] == "has no working driver: llvmpipe (LLVM 15) stands in for it; install the GPU's driver"
    assert reasons[2] is None


@pytest.mark.parametrize(
    ("index", "message"),
    [
        (0, r"rendering\.gpus: EGL device 0 \(NVIDIA H200\) cannot be opened: 0x3001.*set rendering\.gpus: \[\]"),
        (2, r"rendering\.gpus: EGL device 2 is not a GPU but Mesa's software renderer"),
        (7, r"rendering\.gpus: EGL has no device 7; it has 0 \(NVIDIA H200\), 1 \(NVIDIA H200\), 2 \(Mesa"),
    ],
)
def test_a_requested_gpu_that_is_unavailable_is_an_error(machine: Any, index: int, message: str) -> None:
    machine(*GPUS, MESA, failures={0: "0x3001"})
    with pytest.raises(RenderError, match=message) as caught:
        open_context(index)
    assert caught.value.exit_code == 2


def test_a_device_file_without_permission_is_reported_with_the_group(
    machine: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    file = tmp_path / "renderD128"
    file.touch()
    monkeypatch.setattr(os, "access", lambda *_: False)  # root may open everything
    machine(EglDevice(0, "AMD", software=False, file=str(file)), failures={0: "eglInitialize failed (0x3001)"})
    with pytest.raises(RenderError, match=rf"no right to use {file}; .*usermod -aG render .*--device /dev/dri"):
        open_context(0)


@pytest.mark.parametrize("variable", ["LIBGL_ALWAYS_SOFTWARE=1", "GALLIUM_DRIVER=llvmpipe"])
def test_a_request_for_software_rendering_applies_to_every_driver(
    machine: Any, monkeypatch: pytest.MonkeyPatch, variable: str
) -> None:
    machine(*GPUS, MESA)
    monkeypatch.setenv(*variable.split("="))
    assert opened_index("auto", 1) == 2
    with pytest.raises(RenderError, match=rf"asks for EGL device 0, but {variable} forbids GPUs"):
        open_context(0)
    monkeypatch.setenv("LIBGL_ALWAYS_SOFTWARE", "false")
    monkeypatch.delenv("GALLIUM_DRIVER", raising=False)
    assert opened_index("auto", 1) == 1


def test_without_mesa_the_cpu_cannot_render(machine: Any) -> None:
    machine(*GPUS)
    with pytest.raises(RenderError, match=r"Mesa, which renders on the CPU, is not installed \(.*apt install libegl1"):
        open_context("cpu")


def test_a_missing_libegl_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> None:
        raise OSError(f"{name}: cannot open shared object file")

    monkeypatch.setattr(ctypes, "CDLL", missing)
    with pytest.raises(RenderError, match=r"EGL, which is not installed \(libEGL\.so\.1: .*apt install libegl1"):
        list_devices()


@pytest.mark.parametrize(
    ("variable", "message"),
    [
        (
            "__EGL_VENDOR_LIBRARY_FILENAMES=/nonexistent",
            "EGL has no device to render on: it looks for drivers only where",
        ),
        ("MESA_GL_VERSION_OVERRIDE=3.0", "has only OpenGL 3.0 Mesa"),
        ("MESA_EXTENSION_OVERRIDE=-GL_ARB_shader_storage_buffer_object", "is needed; unset MESA_EXTENSION_OVERRIDE="),
        ("GALLIUM_DRIVER=none", "cannot be opened: eglInitialize failed (0x3001); unset GALLIUM_DRIVER=none"),
        ("GLCONTEXT_LINUX_LIBGL=libGL.so.77", "libGL.so.77 not loaded. Install it (Debian"),
    ],
)
def test_a_real_egl_that_is_broken_says_what_to_set(variable: str, message: str) -> None:
    name, value = variable.split("=")
    program = "from simbev_ros.simulation.render.gl.context import open_context; open_context('cpu')"
    environment = {**os.environ, name: value}
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, env=environment)
    assert done.returncode == 1
    assert message in done.stderr
    assert value in done.stderr.splitlines()[-1]


def test_the_device_in_use_is_in_the_survey() -> None:
    assert describe_renderer() in [survey.renderer for survey in survey_devices()]


@pytest.fixture(scope="module")
def real() -> moderngl.Context:
    return open_context()


def test_out_of_memory_is_an_error_with_the_size_and_what_to_lower(real: moderngl.Context) -> None:
    if "llvmpipe" not in real.info["GL_RENDERER"]:
        pytest.skip("GPU drivers take memory only when it is used")
    with (
        pytest.raises(
            RenderError, match=r"llvmpipe.* does not have enough memory left for it all \(about 65536 MiB\)\. Lower"
        ),
        check_memory(real, "it all", 1 << 36),
    ):
        real.buffer(reserve=1 << 36)
    with check_memory(real, "little"):
        real.buffer(reserve=1 << 10)


def test_other_driver_errors_are_not_mistaken_for_out_of_memory(real: moderngl.Context) -> None:
    with pytest.raises(moderngl.Error, match="something else"), check_memory(real, "it"):
        raise moderngl.Error("something else")


def test_a_compile_error_names_the_shader_the_driver_and_a_workaround(
    real: moderngl.Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    library = ProgramLibrary(real)
    monkeypatch.setattr(library, "_read", lambda name: f"#version 330\nvoid main() {{ {name.split('.')[0]} }}")
    with pytest.raises(RenderError) as caught:
        library.load("screen", "labels.frag")
    message = str(caught.value)
    assert "does not compile shaders screen, labels.frag" in message
    assert real.info["GL_RENDERER"] in message and "LIBGL_ALWAYS_SOFTWARE=1" in message
    assert "syntax error" in message
