"""Workers of one machine: how many there are, with which shares, and when they come and go; no process is started."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, ClassVar

import pytest
from fake_pool import COST

from simbev_ros.config.rendering import Rendering
from simbev_ros.config.scenario import Scenario
from simbev_ros.dataset.plan import PlannedEntry
from simbev_ros.foundation.object_store.object_path import ObjectPath
from simbev_ros.production import ProductionObserver
from simbev_ros.production.events import ProductionEvent, WorkersChosen
from simbev_ros.production.object_upload import ObjectUploader
from simbev_ros.production.scene_ending import MadeScene
from simbev_ros.production.workers import local_pool
from simbev_ros.production.workers.local_pool import LocalPool
from simbev_ros.production.workers.messages import Settings, Signal
from simbev_ros.production.workers.worker_pool import Worker

Start = Callable[..., LocalPool]
MADE = MadeScene({}, "made", {}, COST)


class FakeWorker:
    """Stands for a process: it is ready at once, and makes a scene by the next time that it is asked."""

    all: ClassVar[list["FakeWorker"]] = []

    def __init__(self, worker: Worker, settings: Settings, cores: int) -> None:
        self.worker, self.settings, self.cores = worker, settings, cores
        self.messages: list[Any] = [Signal.READY]
        self.given: list[int] = []
        self.is_ended = False
        self.connection = None
        FakeWorker.all.append(self)

    def submit(self, entry: PlannedEntry) -> None:
        self.given.append(entry.number)
        self.messages += [MADE, Signal.READY]

    def read(self) -> list[Any]:
        messages, self.messages = self.messages[:1], self.messages[1:]
        return messages

    def end(self) -> None:
        self.is_ended = True

    def join(self) -> None:
        pass


class Choice(ProductionObserver):
    """Keeps the number of workers that was chosen."""

    workers: int | None = None

    def notify(self, event: ProductionEvent) -> None:
        if isinstance(event, WorkersChosen):
            self.workers = event.workers


def share_gpus(workers: int, scenario: Scenario) -> list[Rendering | None]:
    """A GPU for each of several workers."""
    return [Rendering(gpus=(k,)) for k in range(workers)] if workers > 1 else [None]


@pytest.fixture
def pool(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Start:
    """Function that makes a pool of fake workers on a machine that has room for three workers, with three GPUs."""
    monkeypatch.setattr(FakeWorker, "all", [])
    monkeypatch.setattr(local_pool, "LocalWorker", FakeWorker)
    monkeypatch.setattr(local_pool, "wait", lambda *_: [])
    monkeypatch.setattr(local_pool, "fitting_workers", lambda *_: 3)
    monkeypatch.setattr(local_pool, "share_gpus", share_gpus)
    scenario = Scenario.model_validate({"scenes": [{"map": "Blocks", "train": 1}], "rig": {"sensors": []}})
    return lambda workers, scenes, *more, **options: LocalPool(scenario, tmp_path, workers, scenes, *more, **options)


def make(pool: LocalPool, scenes: int) -> int:
    """Make scenes as the driver does; return the largest number of scenes in the making."""
    number, made, largest = 0, 0, 0
    with pool:
        while made < scenes:
            for worker in pool.idle():
                if number < scenes:
                    pool.submit(worker, PlannedEntry(number=number, map="Blocks", split="train"))
                    number += 1
            largest = max(largest, number - made)
            made += len(pool.wait(0.01))
    assert all(worker.is_ended for worker in FakeWorker.all)
    return largest


def test_each_worker_has_a_gpu_and_a_folder_of_its_own(pool: Start, tmp_path: Path) -> None:
    assert make(pool(2, 5), 5) == 2
    settings = [worker.settings for worker in FakeWorker.all]
    assert [each.rendering for each in settings] == share_gpus(2, settings[0].scenario)
    assert [each.staging for each in settings] == [tmp_path / "worker-1", tmp_path / "worker-2"]


def test_many_workers_plan_with_few_cores(pool: Start, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(local_pool, "usable_cores", lambda: 16)
    make(pool("auto", 20), 20)
    assert [worker.cores for worker in FakeWorker.all] == [16, 11, 11, 11]


def test_there_are_never_more_workers_than_scenes(pool: Start) -> None:
    assert make(pool(9, 2), 2) == 2


def test_after_the_first_scene_its_worker_gives_way_to_as_many_as_fit(pool: Start) -> None:
    choice = Choice()
    assert make(pool("auto", 20, choice), 20) == 3
    assert choice.workers == 3
    assert FakeWorker.all[0].given == [0], "it renders on all GPUs"
    settings = [worker.settings for worker in FakeWorker.all]
    assert [each.rendering for each in settings] == [None, *share_gpus(3, settings[0].scenario)]


def test_on_one_gpu_the_first_worker_stays(pool: Start, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(local_pool, "share_gpus", lambda workers, _: [None] * workers)
    assert make(pool("auto", 20), 20) == 3
    assert len(FakeWorker.all) == 3 and len(FakeWorker.all[0].given) > 1


@pytest.mark.parametrize(("scenes", "chosen", "started"), [(1, 1, 1), (2, 1, 1), (3, 2, 3)])
def test_workers_are_chosen_for_the_scenes_that_are_left(pool: Start, scenes: int, chosen: int, started: int) -> None:
    choice = Choice()
    make(pool("auto", scenes, choice), scenes)
    assert (choice.workers, len(FakeWorker.all)) == (chosen, started)


def test_each_worker_has_an_uploader_of_its_own(pool: Start) -> None:
    make(pool(2, 2, uploader_for=lambda worker: ObjectUploader(ObjectPath("bucket", worker))), 2)
    urls = [str(worker.settings.uploader.folder) for worker in FakeWorker.all]
    assert urls == ["s3://bucket/worker-1", "s3://bucket/worker-2"]
