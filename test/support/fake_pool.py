"""A pool without processes: its workers end their scenes one after the other, in the way that a test asks for."""

from collections.abc import Sequence
from pathlib import Path
from typing import Self

from made_up_scene import made_up_scene

from simbev_ros.dataset.index_row import index_row
from simbev_ros.dataset.plan import PlannedEntry, bag_of
from simbev_ros.production.scene_cost import SceneCost
from simbev_ros.production.scene_ending import FailedScene, LostScene, MadeScene, SceneEnding
from simbev_ros.production.workers.worker_pool import Worker
from simbev_ros.recording.layout import partial_of

COST = SceneCost(wall_s=1.0, cpu_s=2.0, memory_mib=100.0, frames=2)


class FakePool:
    """Workers of which each has a machine; a worker that is lost is replaced at once.

    Args:
        staging: Folder for the workers' folders.
        machines: For each worker the name of its machine.

    Attributes:
        endings: By number of scene the endings of its first attempts; later ones succeed.
        given: Number of scene and machine of each attempt.
        latest_first: Whether the scene that was given last is the next to end, instead of the first one.
    """

    def __init__(self, staging: Path, *machines: str) -> None:
        self._staging = staging
        self._workers = [Worker(f"worker-{k + 1}", machine) for k, machine in enumerate(machines)]
        self._started = len(self._workers)
        self._busy: list[tuple[Worker, PlannedEntry]] = []
        self.machines = len(set(machines))
        self.endings: dict[int, list[FailedScene | LostScene]] = {}
        self.given: list[tuple[int, str]] = []
        self.latest_first = False

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._workers.clear()

    def idle(self) -> Sequence[Worker]:
        """Workers without a scene."""
        busy = [worker for worker, _ in self._busy]
        return [worker for worker in self._workers if worker not in busy]

    def submit(self, worker: Worker, entry: PlannedEntry) -> None:
        """Begin a scene, which leaves an unfinished bag."""
        self.given.append((entry.number, worker.machine))
        self._busy.append((worker, entry))
        partial_of(bag_of(self._staging / worker.name, entry)).mkdir(parents=True)

    def wait(self, timeout_s: float) -> list[tuple[Worker, PlannedEntry, SceneEnding]]:
        """End one scene."""
        worker, entry = self._busy.pop(-1 if self.latest_first else 0)
        folder = self._staging / worker.name
        partial_of(bag_of(folder, entry)).rmdir()
        ending: SceneEnding
        if endings := self.endings.get(entry.number):
            ending = endings.pop(0)
        else:
            made_up_scene(bag_of(folder, entry), number=entry.number, split=entry.split, ticks=2)
            ending = MadeScene(index_row(bag_of(folder, entry), folder), "made", {}, COST)
        if isinstance(ending, LostScene):
            self._started += 1
            self._workers[self._workers.index(worker)] = Worker(f"worker-{self._started}", worker.machine)
        return [(worker, entry, ending)]
