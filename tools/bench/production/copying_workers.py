"""Workers that copy a recorded scene instead of playing one: in the driver's process, and as actors on a Ray cluster.

In: a scene of the dataset's plan. Out: a bag in the worker's staging folder, and its row of the index, taken from the
recorded scene.
"""

import shutil
import time
from collections import deque
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any, ClassVar, Self

from simbev_ros.dataset.index_row import Row, index_row
from simbev_ros.dataset.plan import PlannedEntry, bag_of
from simbev_ros.foundation.errors import InputError, SimbevError
from simbev_ros.foundation.files.whole_files import write_errors
from simbev_ros.production.cluster.node_check import Code
from simbev_ros.production.cluster.ray_cluster import this_node
from simbev_ros.production.scene_cost import SceneCost
from simbev_ros.production.scene_ending import FailedScene, MadeScene, SceneEnding
from simbev_ros.production.workers.messages import Settings, Signal
from simbev_ros.production.workers.ray_worker import Answer
from simbev_ros.production.workers.worker_pool import Worker
from simbev_ros.recording.layout import finished_scenes
from simbev_ros.schema.scene.map_spec import MapSpec

_POLL_S = 1.0
_COST = SceneCost(wall_s=1.0, cpu_s=1.0, memory_mib=200.0, frames=1)
"""Cost that copies report, so that workers on a cluster ask for one CPU and the least memory."""


@dataclass(frozen=True, slots=True)
class RecordedScene:
    """A finished scene to copy: its bag and its row of the index."""

    bag: Path
    row: Row

    @classmethod
    def first_of(cls, dataset: Path) -> Self:
        """The first scene of a dataset.

        Raises:
            InputError: There is none that is finished.
            BagError: It is damaged.
        """
        bag = next(iter(finished_scenes(dataset)), None)
        if bag is None:
            raise InputError(f"{dataset}: has no finished scene to copy")
        return cls(bag, index_row(bag, dataset))

    def copy(self, staging: Path, entry: PlannedEntry) -> SceneEnding:
        """Copy the bag under the name of another scene.

        Args:
            staging: Folder of the worker, laid out like a dataset.
            entry: The scene.
        """
        bag = bag_of(staging, entry)
        try:
            with write_errors(bag):
                bag.mkdir(parents=True)
                for file in self.bag.iterdir():
                    if file.is_file():
                        shutil.copyfile(file, bag / file.name.replace(self.bag.name, entry.name, 1))
        except SimbevError as error:
            return FailedScene(error)
        names = {"number": entry.number, "name": entry.name, "path": str(bag.relative_to(staging))}
        return MadeScene({**self.row, **names}, "copied", {}, _COST)


class CopyingPool:
    """Workers in this process that copy a scene one after the other, while the driver waits for them.

    Args:
        recorded: The scene to copy.
        staging: Folder for unfinished scenes; each worker has a folder in it.
        workers: Number of workers.

    Attributes:
        copying_s: Time that copies have taken.
    """

    machines = 1

    def __init__(self, recorded: RecordedScene, staging: Path, workers: int) -> None:
        self._recorded, self._staging = recorded, staging
        self._idle = [Worker(f"worker-{number}", "this machine") for number in range(1, workers + 1)]
        self._busy: deque[tuple[Worker, PlannedEntry]] = deque()
        self.copying_s = 0.0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._busy.clear()

    def idle(self) -> Sequence[Worker]:
        """Workers without a scene."""
        return list(self._idle)

    def submit(self, worker: Worker, entry: PlannedEntry) -> None:
        """Note the scene to copy."""
        self._idle.remove(worker)
        self._busy.append((worker, entry))

    def wait(self, timeout_s: float) -> list[tuple[Worker, PlannedEntry, SceneEnding]]:
        """Copy the scene that has waited longest."""
        worker, entry = self._busy.popleft()
        began_s = time.perf_counter()
        ending = self._recorded.copy(self._staging / worker.name, entry)
        self.copying_s += time.perf_counter() - began_s
        self._idle.append(worker)
        return [(worker, entry, ending)]


class _CopyingActor:
    """Copies scenes on a node; it has the methods of ``WorkerActor``."""

    recorded: ClassVar[RecordedScene]

    def __init__(self, name: str, settings: Settings, code: Code, map_files: Mapping[MapSpec, Any]) -> None:
        assert settings.staging is not None, "nodes and driver share a folder"
        self._node, self._staging = this_node(), settings.staging
        self._messages: SimpleQueue[Any] = SimpleQueue()
        self._messages.put(Signal.READY)

    def poll(self) -> Answer:
        """The messages of at most a second; less as soon as there is one."""
        messages: list[Any] = []
        with suppress(Empty):
            messages.append(self._messages.get(timeout=_POLL_S))
            while True:
                messages.append(self._messages.get_nowait())
        return Answer(self._node, messages, None)

    def submit(self, entry: PlannedEntry) -> None:
        """Copy the scene."""
        self._messages.put(self.recorded.copy(self._staging, entry))
        self._messages.put(Signal.READY)

    def end(self) -> None:
        """Nothing is left to end."""


def copying_actor(recorded: RecordedScene) -> type[Any]:
    """Class of actors that copy a scene, in place of ``WorkerActor``.

    Args:
        recorded: The scene; all nodes see its bag.
    """

    class CopyingActor(_CopyingActor):
        pass

    CopyingActor.recorded = recorded
    return CopyingActor
