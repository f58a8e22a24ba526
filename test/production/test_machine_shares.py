"""Shares of mock machines: cores and GPUs of each worker, and how many workers fit."""

import os
from collections.abc import Callable, Sequence

import pytest

from simbev_ros.config.scenario import Scenario
from simbev_ros.production.scene_cost import SceneCost
from simbev_ros.production.workers import machine_shares as module
from simbev_ros.production.workers.machine_shares import Share, fitting_workers, machine_shares
from simbev_ros.render.gl import devices
from simbev_ros.render.gl.devices import EglDevice

Machine = Callable[..., None]


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch) -> Machine:
    """Mock cores, GPUs and free memory; hyper-threads k and k + n/2 of n are on one core."""
    for name in ("LIBGL_ALWAYS_SOFTWARE", "GALLIUM_DRIVER", "MESA_LOADER_DRIVER_OVERRIDE"):
        monkeypatch.delenv(name, raising=False)

    def build(cores: Sequence[int] = range(4), gpus: int = 0, free_mib: float = 1e6) -> None:
        listed = tuple(EglDevice(index, "NVIDIA H200", software=False) for index in range(gpus))
        monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(cores))
        monkeypatch.setattr(module, "_topology", lambda core: (0, core % max(len(cores) // 2, 1), core))
        monkeypatch.setattr(devices, "list_devices", lambda: listed)
        monkeypatch.setattr(module, "free_memory_mib", lambda: free_mib)

    return build


def scenario(*, cameras: int = 1, **rendering: object) -> Scenario:
    sensors = [{"type": "camera", "name": f"camera_{k}"} for k in range(cameras)]
    content = {"scenes": [{"map": "Blocks", "train": 1}], "rig": {"sensors": sensors}, "rendering": rendering}
    return Scenario.model_validate(content)


def gpus_of(shares: list[Share]) -> list[object]:
    return [None if share.rendering is None else share.rendering.gpus for share in shares]


@pytest.mark.parametrize("cores", [range(4), range(8, 24), [1, 5, 7, 9, 30]], ids=["4", "16", "some"])
def test_shares_are_disjoint_and_use_all_cores(machine: Machine, cores: Sequence[int]) -> None:
    machine(cores)
    for workers in range(2, len(cores) + 1):
        shares = [share.cores for share in machine_shares(workers, scenario())]
        assert len(shares) == workers
        assert sorted(core for share in shares for core in share) == list(cores)
        sizes = [len(share) for share in shares]
        assert max(sizes) - min(sizes) <= 1


def test_hyper_threads_of_a_core_stay_together(machine: Machine) -> None:
    machine(range(8))
    assert [share.cores for share in machine_shares(4, scenario())] == [(0, 4), (1, 5), (2, 6), (3, 7)]


@pytest.mark.parametrize("workers", [1, 5, 60])
def test_a_single_worker_and_more_workers_than_cores_use_all_cores(machine: Machine, workers: int) -> None:
    machine(range(4))
    assert machine_shares(workers, scenario()) == [Share()] * workers


def test_workers_take_turns_on_several_gpus(machine: Machine) -> None:
    machine(range(16), gpus=2)
    assert gpus_of(machine_shares(5, scenario())) == [(0,), (1,), (0,), (1,), (0,)]
    assert gpus_of(machine_shares(3, scenario(gpus=[5, 2]))) == [(5,), (2,), (5,)]


def test_with_more_gpus_than_workers_all_gpus_are_used(machine: Machine) -> None:
    machine(range(16), gpus=5)
    assert gpus_of(machine_shares(2, scenario())) == [(0, 2, 4), (1, 3)]


def test_workers_render_as_configured_on_one_gpu_on_the_cpu_and_without_cameras(
    machine: Machine, monkeypatch: pytest.MonkeyPatch
) -> None:
    machine(range(16), gpus=1)
    assert gpus_of(machine_shares(3, scenario())) == [None] * 3
    machine(range(16), gpus=4)
    assert gpus_of(machine_shares(1, scenario())) == [None]
    assert gpus_of(machine_shares(2, scenario(gpus=[]))) == [None] * 2
    assert gpus_of(machine_shares(2, scenario(cameras=0))) == [None] * 2
    monkeypatch.setenv("LIBGL_ALWAYS_SOFTWARE", "1")
    assert gpus_of(machine_shares(2, scenario())) == [None] * 2


def test_a_worker_keeps_the_rest_of_the_configured_rendering(machine: Machine) -> None:
    machine(range(16), gpus=2)
    [first, _] = machine_shares(2, scenario(quality="high", processes=3))
    assert first.rendering is not None
    assert (first.rendering.quality, first.rendering.processes, first.rendering.gpus) == ("high", 3, (0,))


@pytest.mark.parametrize(
    ("cores", "used", "free_mib", "workers"),
    [
        (16, 4.0, 1e6, 4),  # a quarter of the cores each
        (16, 3.0, 1e6, 5),
        (2, 1.9, 1e6, 1),
        (2, 5.0, 1e6, 1),  # more threads than cores
        (16, 2.0, 2500.0, 3),  # the first one, and two in 2500 MiB at 1200 MiB each
        (16, 2.0, 0.0, 1),
        (4, 0.0, 1e6, 40),  # too short to be measured
        (256, 1.0, 1e6, 60),  # one ROS domain each
    ],
)
def test_workers_fit_by_cores_memory_and_domains(
    machine: Machine, cores: int, used: float, free_mib: float, workers: int
) -> None:
    machine(range(cores), free_mib=free_mib)
    cost = SceneCost(wall_s=10.0, cpu_s=10.0 * used, memory_mib=1000.0, frames=10)
    assert fitting_workers(cost, cores) == workers
