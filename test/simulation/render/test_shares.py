"""Numbers of rendering processes and of their threads, on mock machines."""

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from simbev_ros.config.rendering import Rendering
from simbev_ros.simulation.render.gl import devices
from simbev_ros.simulation.render.gl.devices import EglDevice, accessible_gpus
from simbev_ros.simulation.render.shares import camera_processes, drawing_environment

STEERING = ("LIBGL_ALWAYS_SOFTWARE", "GALLIUM_DRIVER", "MESA_LOADER_DRIVER_OVERRIDE")
MESA = EglDevice(9, "Mesa's software renderer", software=True)

Machine = Callable[..., None]


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch) -> Machine:
    """Mock the cores and devices of this machine."""
    for name in (*STEERING, "LP_NUM_THREADS", "__GL_YIELD"):
        monkeypatch.delenv(name, raising=False)

    def build(cores: int, *gpus: EglDevice) -> None:
        monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(cores)))
        monkeypatch.setattr(devices, "list_devices", lambda: (*gpus, MESA))

    return build


def gpu(index: int, file: str | None = None) -> EglDevice:
    return EglDevice(index, "NVIDIA H200", software=False, file=file)


def processes(cameras: int = 6, **rendering: object) -> int:
    return camera_processes(Rendering.model_validate(rendering), cameras)


def test_on_the_cpu_there_is_one_process_per_core_up_to_the_number_of_cameras(machine: Machine) -> None:
    machine(4)
    assert [processes(cameras) for cameras in (0, 1, 3, 6)] == [0, 1, 3, 4]
    assert [processes(processes=number) for number in (1, 2, 16)] == [1, 2, 6]


def test_every_gpu_in_use_has_a_process(machine: Machine, monkeypatch: pytest.MonkeyPatch) -> None:
    machine(15, gpu(0), gpu(1))
    assert (processes(), processes(gpus=[0, 1]), processes(gpus=[]), processes(processes=3)) == (2, 2, 6, 3)
    monkeypatch.setenv("LIBGL_ALWAYS_SOFTWARE", "1")
    assert processes() == 6


def test_a_gpu_with_many_cores_has_two_processes(machine: Machine) -> None:
    machine(16, gpu(0), gpu(1))
    assert (processes(), processes(gpus=[1]), processes(cameras=1)) == (4, 2, 1)


def test_a_gpu_listed_by_two_drivers_counts_once_and_an_inaccessible_one_not_at_all(
    machine: Machine, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    file = tmp_path / "renderD128"
    file.touch()
    machine(4, gpu(0, str(file)), gpu(1, str(file)))
    assert processes() == 1
    monkeypatch.setattr(os, "access", lambda *_: False)
    assert processes() == 4


def test_of_the_drivers_that_list_a_gpu_the_one_with_the_lowest_number_is_used(machine: Machine) -> None:
    machine(4, gpu(0, "/dev/none0"), gpu(1, "/dev/none1"), gpu(2, "/dev/none1"), gpu(3, "/dev/none0"), gpu(4))
    assert [device.index for device in accessible_gpus()] == [0, 1, 4]


def test_the_software_renderer_is_no_gpu(machine: Machine) -> None:
    machine(4)
    assert accessible_gpus() == ()


def test_processes_share_the_cores_unless_the_user_sets_the_threads(
    machine: Machine, monkeypatch: pytest.MonkeyPatch
) -> None:
    machine(8)
    assert [drawing_environment(number)["LP_NUM_THREADS"] for number in (0, 1, 3, 16)] == ["8", "8", "2", "1"]
    assert drawing_environment(1)["__GL_YIELD"] == "USLEEP"
    monkeypatch.setenv("LP_NUM_THREADS", "5")
    monkeypatch.setenv("__GL_YIELD", "NOTHING")
    assert drawing_environment(2) == {"LP_NUM_THREADS": "5", "__GL_YIELD": "NOTHING"}
