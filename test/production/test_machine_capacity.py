"""Mock machines: GPUs of each worker, and how many workers fit."""

from collections.abc import Callable

import pytest

from simbev_ros.config.agents import Agent
from simbev_ros.config.rendering import Rendering
from simbev_ros.config.scenario import Scenario
from simbev_ros.production.scene_cost import SceneCost
from simbev_ros.production.workers import machine_capacity as module
from simbev_ros.production.workers.machine_capacity import cores_of_worker, fitting_workers, share_gpus
from simbev_ros.simulation.render.gl import devices
from simbev_ros.simulation.render.gl.devices import EglDevice

Machine = Callable[..., None]


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch) -> Machine:
    """Mock GPUs and free memory."""
    for name in ("LIBGL_ALWAYS_SOFTWARE", "GALLIUM_DRIVER", "MESA_LOADER_DRIVER_OVERRIDE"):
        monkeypatch.delenv(name, raising=False)

    def build(gpus: int = 0, free_mib: float = 1e6) -> None:
        listed = tuple(EglDevice(index, "NVIDIA H200", software=False) for index in range(gpus))
        monkeypatch.setattr(devices, "list_devices", lambda: listed)
        monkeypatch.setattr(module, "free_memory_mib", lambda: free_mib)

    return build


def scenario(*, cameras: int = 1, **rendering: object) -> Scenario:
    sensors = [{"type": "camera", "name": f"camera_{k}"} for k in range(cameras)]
    content = {"scenes": [{"map": "Blocks", "train": 1}], "rig": {"sensors": sensors}, "rendering": rendering}
    return Scenario.model_validate(content)


def gpus_of(shares: list[Rendering | None]) -> list[object]:
    return [None if share is None else share.gpus for share in shares]


def test_workers_take_turns_on_several_gpus(machine: Machine) -> None:
    machine(gpus=2)
    assert gpus_of(share_gpus(5, scenario())) == [(0,), (1,), (0,), (1,), (0,)]
    assert gpus_of(share_gpus(3, scenario(gpus=[5, 2]))) == [(5,), (2,), (5,)]


def test_cameras_of_any_agent_render_on_the_gpus(machine: Machine) -> None:
    machine(gpus=2)
    rig = scenario().rig
    blind = scenario(cameras=0)
    seeing = blind.model_copy(update={"agents": (Agent(name="car", rig=rig),)})
    assert gpus_of(share_gpus(2, blind)) == [None] * 2
    assert gpus_of(share_gpus(2, seeing)) == [(0,), (1,)]


def test_with_more_gpus_than_workers_all_gpus_are_used(machine: Machine) -> None:
    machine(gpus=5)
    assert gpus_of(share_gpus(2, scenario())) == [(0, 2, 4), (1, 3)]


def test_workers_render_as_configured_on_one_gpu_on_the_cpu_and_without_cameras(
    machine: Machine, monkeypatch: pytest.MonkeyPatch
) -> None:
    machine(gpus=1)
    assert gpus_of(share_gpus(3, scenario())) == [None] * 3
    machine(gpus=4)
    assert gpus_of(share_gpus(1, scenario())) == [None]
    assert gpus_of(share_gpus(2, scenario(gpus=[]))) == [None] * 2
    assert gpus_of(share_gpus(2, scenario(cameras=0))) == [None] * 2
    monkeypatch.setenv("LIBGL_ALWAYS_SOFTWARE", "1")
    assert gpus_of(share_gpus(2, scenario())) == [None] * 2


def test_a_worker_keeps_the_rest_of_the_configured_rendering(machine: Machine) -> None:
    machine(gpus=2)
    [first, _] = share_gpus(2, scenario(quality="high", processes=3))
    assert first is not None
    assert (first.quality, first.processes, first.gpus) == ("high", 3, (0,))


@pytest.mark.parametrize(
    ("cores", "used", "free_mib", "workers"),
    [
        (16, 2.0, 1e6, 8),  # an eighth of the cores each
        (16, 10.6, 1e6, 5),  # as many as it finds idle, so it counts as three
        (2, 1.9, 1e6, 1),
        (2, 1.2, 1e6, 2),
        (16, 2.0, 2500.0, 3),  # the first one, and two in 2500 MiB at 1200 MiB each
        (16, 2.0, 0.0, 1),
        (4, 0.0, 1e6, 40),  # too short to be measured
        (256, 1.0, 1e6, 60),  # one ROS domain each
    ],
)
def test_workers_fit_by_cores_memory_and_domains(
    machine: Machine, cores: int, used: float, free_mib: float, workers: int
) -> None:
    machine(free_mib=free_mib)
    cost = SceneCost(wall_s=10.0, cpu_s=10.0 * used, memory_mib=1000.0, frames=10)
    assert fitting_workers(cost, cores) == workers


@pytest.mark.parametrize(("workers", "share"), [(1, 16), (2, 16), (3, 11), (8, 4), (28, 2), (100, 1)])
def test_a_worker_plans_with_twice_its_share_of_the_cores(workers: int, share: int) -> None:
    assert cores_of_worker(workers, 16) == share
