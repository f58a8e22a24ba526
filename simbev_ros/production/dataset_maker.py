"""The driver of a dataset's production: assigns scenes to workers, retries what fails, and commits what is made."""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import assert_never

from simbev_ros.dataset.plan import PlannedEntry
from simbev_ros.dataset.staging import ON_FULL_DISK
from simbev_ros.foundation.errors import DiskError, GraphError, InputError, SimbevError, UploadError
from simbev_ros.production.dataset_storage import DatasetStorage
from simbev_ros.production.events import DatasetEnded, DatasetStarted, SceneFailed, SceneMade, SceneRetried
from simbev_ros.production.observer import SILENT, ProductionObserver
from simbev_ros.production.scene_ending import FailedScene, LostScene, MadeScene, SceneEnding
from simbev_ros.production.scene_log import Attempt
from simbev_ros.production.workers.worker_pool import Worker, WorkerPool
from simbev_ros.recording.bag_files import disk_error_consequence
from simbev_ros.ros.graph.resources import reap_killed_graphs

_POLL_S = 1.0
_MAX_LOSSES = 10
"""Workers that may be lost with a scene before the scene itself is blamed."""


@dataclass(slots=True)
class Outcome:
    """The scenes that were made, and by the name of each scene that failed or is damaged the reason."""

    made: list[PlannedEntry] = field(default_factory=list)
    failed: dict[str, str] = field(default_factory=dict)
    damaged: dict[str, str] = field(default_factory=dict)


@dataclass(slots=True)
class _History:
    """The attempts at a scene so far."""

    attempts: int = 0
    losses: int = 0
    machines: set[str] = field(default_factory=set)
    latest: Attempt | None = None


class DatasetMaker:
    """Has scenes made by a pool. The caller holds the dataset's lock, and closes pool and dataset.

    Args:
        storage: The dataset.
        pool: The workers.
        retries: Number of further attempts at a scene that has failed for a reason of its own.
        observer: Receives the progress.
    """

    def __init__(
        self, storage: DatasetStorage, pool: WorkerPool, *, retries: int, observer: ProductionObserver = SILENT
    ) -> None:
        self._storage, self._pool, self._retries, self._observer = storage, pool, retries, observer
        self._waiting: deque[PlannedEntry] = deque()
        self._histories: dict[PlannedEntry, _History] = {}
        self._busy = 0
        self._first: PlannedEntry | None = None
        self._outcome = Outcome()
        reap_killed_graphs()  # also where nothing is left to make

    def make(self, entries: Sequence[PlannedEntry]) -> Outcome:
        """Make scenes; failures are collected, as are the damaged bags of the dataset that remain.

        Raises:
            InputError: The first scene cannot be made with this configuration.
            DiskError: The disk is full, or nearly; the scenes made before are complete.
            GraphError: No worker can be started.
        """
        self._waiting.extend(entries)
        self._first = next(iter(entries), None)
        self._observer.notify(DatasetStarted(len(entries), self._storage.total_bytes))
        try:
            with disk_error_consequence(ON_FULL_DISK):
                while self._waiting or self._busy:
                    self._submit_scenes()
                    for worker, entry, ending in self._pool.wait(_POLL_S):
                        self._busy -= 1
                        self._settle(worker, entry, ending)
        finally:
            self._observer.notify(DatasetEnded())
        self._outcome.damaged.update(self._storage.damaged)
        return self._outcome

    def _submit_scenes(self) -> None:
        """Assign each idle worker a scene, if there is one that it has not failed at before while others could try."""
        for worker in self._pool.idle():
            entry = next((entry for entry in self._waiting if self._may_try(worker, entry)), None)
            if entry is None:
                continue
            self._storage.check_space(self._busy + 1)
            self._waiting.remove(entry)
            history = self._histories.setdefault(entry, _History())
            history.attempts += 1
            history.latest = Attempt(entry.name, history.attempts, f"{worker.name}, {worker.machine}")
            self._pool.submit(worker, entry)
            self._busy += 1

    def _may_try(self, worker: Worker, entry: PlannedEntry) -> bool:
        """Whether a worker's machine is a new one for a scene, or all machines have failed at it."""
        history = self._histories.get(entry)
        if history is None or worker.machine not in history.machines:
            return True
        return len(history.machines) >= self._pool.machines

    def _settle(self, worker: Worker, entry: PlannedEntry, ending: SceneEnding) -> None:
        """Take a finished scene into the dataset, or decide what becomes of one that is not finished."""
        attempt = self._histories[entry].latest
        assert attempt is not None, "it was given to a worker"
        match ending:
            case MadeScene():
                self._storage.commit(worker.name, entry, ending.row)
                self._storage.log(attempt, ending.summary, ending.output)
                del self._histories[entry]
                self._outcome.made.append(entry)
                self._observer.notify(SceneMade(entry, self._storage.total_bytes))
            case LostScene():
                self._storage.discard(worker.name)
                self._storage.log(attempt, ending.reason, {}, failed=True)
                self._handle_loss(entry, ending.reason)
            case FailedScene():
                self._storage.log(attempt, str(ending.error), ending.output, failed=True)
                self._handle_failure(worker, entry, ending.error)
            case _:
                assert_never(ending)

    def _handle_loss(self, entry: PlannedEntry, reason: str) -> None:
        history = self._histories[entry]
        history.losses += 1
        if history.losses < _MAX_LOSSES:
            self._try_again(entry, reason)
        else:
            self._give_up(entry, f"{history.losses} workers were lost while they made it; the last one: {reason}")

    def _handle_failure(self, worker: Worker, entry: PlannedEntry, error: SimbevError) -> None:
        """Retry after a failure of graph or upload, and on another machine what may be this machine's fault."""
        history = self._histories[entry]
        history.machines.add(worker.machine)
        is_elsewhere_left = len(history.machines) < self._pool.machines
        if isinstance(error, DiskError) and not is_elsewhere_left:
            raise error
        if isinstance(error, InputError) and not is_elsewhere_left and entry == self._first and not self._outcome.made:
            raise error
        failures = history.attempts - history.losses
        if is_elsewhere_left or (isinstance(error, GraphError | UploadError) and failures <= self._retries):
            self._try_again(entry, str(error))
        else:
            self._give_up(entry, str(error))

    def _try_again(self, entry: PlannedEntry, reason: str) -> None:
        self._waiting.appendleft(entry)
        self._observer.notify(SceneRetried(entry, reason))

    def _give_up(self, entry: PlannedEntry, reason: str) -> None:
        self._outcome.failed[entry.name] = reason
        self._observer.notify(SceneFailed(entry, reason))
