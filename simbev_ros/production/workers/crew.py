"""The interface between the driver of a dataset and the workers that make its scenes.

The driver gives scenes to idle workers and collects how they ended. It alone decides about retries and writes into the
dataset; workers write into folders of their own. ``OwnProcess`` is the crew of one that makes scenes in the driver's
process; ``local_crew`` and ``ray_crew`` have others.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, Self

from simbev_ros.config.scenario import Scenario
from simbev_ros.dataset.plan import PlannedEntry
from simbev_ros.production.observer import SILENT, ProductionObserver
from simbev_ros.production.scene_maker import Deliveries, FailedScene, MadeScene, SceneMaker, keep_bags


@dataclass(frozen=True, slots=True)
class Worker:
    """A worker as the driver sees it.

    Attributes:
        name: Name of the worker, which no other one has had; also the name of its folder for unfinished scenes.
        machine: Machine that it runs on.
    """

    name: str
    machine: str


@dataclass(frozen=True, slots=True)
class LostScene:
    """A scene whose worker has died or fallen silent before it was done; that says nothing about the scene."""

    reason: str


SceneEnding = MadeScene | FailedScene | LostScene


class Crew(Protocol):
    """Workers, of which each makes one scene at a time. As a context manager it ends them all."""

    def __enter__(self) -> Self:
        """Begin to start workers."""

    def __exit__(self, *_: object) -> None:
        """End all workers; nothing of them is left."""

    def idle(self) -> Sequence[Worker]:
        """Workers that wait for a scene."""

    def give(self, worker: Worker, entry: PlannedEntry) -> None:
        """Let an idle worker make a scene."""

    def wait(self, timeout_s: float) -> list[tuple[Worker, PlannedEntry, SceneEnding]]:
        """Scenes that have ended since the last call, each with its worker; waits until there is one.

        Progress is reported meanwhile.

        Args:
            timeout_s: Maximum time to wait.

        Raises:
            SimbevError: No worker can be started, so that no further scene would be made.
        """

    @property
    def machines(self) -> int:
        """Number of machines that scenes can be made on."""


class OwnProcess:
    """Crew of one worker: the calling process, which makes a scene while the driver waits for it."""

    machines = 1

    def __init__(
        self,
        scenario: Scenario,
        staging: Path,
        observer: ProductionObserver = SILENT,
        delivery_of: Deliveries = keep_bags,
    ) -> None:
        self._worker = worker = Worker("own", "this machine")
        delivery = delivery_of(worker.name)
        self._maker = SceneMaker(scenario, staging / worker.name, observer, delivery=delivery)
        self._entry: PlannedEntry | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._maker.close()

    def idle(self) -> Sequence[Worker]:
        """This process, unless it has been given a scene."""
        return [] if self._entry else [self._worker]

    def give(self, worker: Worker, entry: PlannedEntry) -> None:
        """Note the scene to make."""
        self._entry = entry

    def wait(self, timeout_s: float) -> list[tuple[Worker, PlannedEntry, SceneEnding]]:
        """Make the scene, however long it takes."""
        entry, self._entry = self._entry, None
        return [] if entry is None else [(self._worker, entry, self._maker.make(entry))]
