"""Base of pools of several workers: follows each worker's messages, reaps lost workers and spawns new ones."""

import time
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, Protocol, Self, assert_never

from simbev_ros.dataset.plan import PlannedEntry
from simbev_ros.foundation.errors import GraphError, SimbevError
from simbev_ros.production.events import (
    DatasetEvent,
    GraphStarted,
    GraphWarned,
    LeftoverRemoved,
    MapNoted,
    ProductionEvent,
    RegionBuilt,
    SceneEnded,
    SceneProgressed,
    SceneRefused,
    SceneStarted,
    StackEvaluated,
    StepEnded,
    StepStarted,
    SurroundingsEnded,
    SurroundingsStarted,
    WorkerPrepares,
)
from simbev_ros.production.observer import SILENT, ProductionObserver
from simbev_ros.production.scene_ending import FailedScene, LostScene, MadeScene, SceneEnding
from simbev_ros.production.workers.messages import Report, Signal
from simbev_ros.production.workers.worker_pool import Worker

_MAX_FAILED_STARTS = 3
"""Workers that may be lost one after the other before any of them was ready."""


class WorkerLost(Exception):
    """A worker has died or fallen silent; the message says how."""


class WorkerHandle(Protocol):
    """The driver's end of a worker."""

    worker: Worker

    def submit(self, entry: PlannedEntry) -> None:
        """Send a scene to make."""

    def read(self) -> list[Any]:
        """Messages that have arrived.

        Raises:
            WorkerLost: The worker has died, or has been silent for too long.
        """

    def end(self) -> None:
        """Ask the worker to end; return at once."""

    def join(self) -> None:
        """Wait for the end of the worker, which is killed if it takes too long."""

    def kill(self) -> None:
        """End the worker at once."""


class _WorkerState:
    """State of a worker, with the scene that it makes."""

    def __init__(self, handle: WorkerHandle) -> None:
        self.handle = handle
        self.is_ready = False
        self.entry: PlannedEntry | None = None
        self.scene: str | None = None


class SupervisedPool(ABC):
    """Pool of several workers.

    Args:
        observer: Receives the progress.
    """

    def __init__(self, observer: ProductionObserver = SILENT) -> None:
        self._observer = observer
        self._noted: set[MapNoted] = set()
        self._states: dict[str, _WorkerState] = {}
        self._failed_starts = 0

    def __enter__(self) -> Self:
        self._scale()
        return self

    def __exit__(self, *_: object) -> None:
        handles = [state.handle for state in self._states.values()]
        self._states.clear()
        for handle in handles:
            handle.end()
        for handle in handles:
            handle.join()

    @abstractmethod
    def _scale(self) -> None:
        """Spawn workers through ``_add_worker``, or stop them, until there are as many as there should be."""

    @abstractmethod
    def _pause(self, timeout_s: float) -> None:
        """Wait until a message may have arrived."""

    def _add_worker(self, handle: WorkerHandle) -> None:
        """Add a worker that was spawned."""
        self._states[handle.worker.name] = _WorkerState(handle)

    def _stop_worker(self, handle: WorkerHandle) -> None:
        """End a worker."""
        del self._states[handle.worker.name]
        handle.end()
        handle.join()

    @abstractmethod
    def _record_cost(self, scene: MadeScene) -> None:
        """Note what a scene has cost."""

    @property
    def _handles(self) -> list[WorkerHandle]:
        return [state.handle for state in self._states.values()]

    def idle(self) -> Sequence[Worker]:
        """Workers that wait for a scene."""
        return [state.handle.worker for state in self._states.values() if state.is_ready and not state.entry]

    def submit(self, worker: Worker, entry: PlannedEntry) -> None:
        """Assign a scene to an idle worker."""
        state = self._states[worker.name]
        state.entry = entry
        state.handle.submit(entry)

    def wait(self, timeout_s: float) -> list[tuple[Worker, PlannedEntry, SceneEnding]]:
        """Scenes that have ended since the last call; waits until there is one, or a worker becomes idle.

        Raises:
            SimbevError: A worker refuses to work, or several workers have died before they were ready.
        """
        end_s, idle_before = time.monotonic() + timeout_s, len(self.idle())
        while True:
            self._scale()
            endings = [ending for state in list(self._states.values()) for ending in self._listen(state)]
            left_s = end_s - time.monotonic()
            if endings or left_s <= 0.0 or len(self.idle()) > idle_before:
                return endings
            self._pause(left_s)

    def _listen(self, state: _WorkerState) -> list[tuple[Worker, PlannedEntry, SceneEnding]]:
        """Act on the messages of a worker; return how its scene has ended, if it has."""
        worker, entry = state.handle.worker, state.entry
        try:
            messages = state.handle.read()
        except WorkerLost as loss:
            self._reap(state, str(loss))
            return [] if entry is None else [(worker, entry, LostScene(str(loss)))]
        endings: list[tuple[Worker, PlannedEntry, SceneEnding]] = []
        for message in messages:
            match message:
                case Report(event):
                    self._forward(state, event)
                case Signal.READY:
                    state.is_ready, self._failed_starts = True, 0
                case MadeScene() | FailedScene() if entry is not None:
                    state.entry, state.is_ready = None, False
                    endings.append((worker, entry, message))
                    if isinstance(message, MadeScene):
                        self._record_cost(message)
                case SimbevError():
                    raise message
                case Signal.HEARTBEAT:
                    pass
                case _:
                    raise AssertionError(f"{worker.name} has sent {message!r:.200}")
        return endings

    def _forward(self, state: _WorkerState, event: ProductionEvent) -> None:
        """Notify the observer of a worker's event."""
        if isinstance(event, SceneStarted):
            state.scene = event.spec.name
        shared = self._event_of_pool(state.handle.worker.name, event)
        if shared is not None:
            self._observer.notify(shared)
        if isinstance(event, SceneEnded):
            state.scene = None

    def _event_of_pool(self, worker: str, event: ProductionEvent) -> ProductionEvent | None:
        """The pool's event for an event of one worker; None: it does not matter to a production with several."""
        if isinstance(event, DatasetEvent):
            raise AssertionError(f"{worker} has sent an event of the driver: {event!r:.200}")
        match event:
            case StepStarted(step):
                return WorkerPrepares(worker, step)
            case SurroundingsStarted(map_name):
                return WorkerPrepares(worker, f"surroundings of {map_name}")
            case StepEnded() | SurroundingsEnded():
                return WorkerPrepares(worker, None)
            case MapNoted():
                is_new = event not in self._noted
                self._noted.add(event)
                return event if is_new else None
            case SceneRefused() | SceneStarted() | SceneProgressed() | SceneEnded() | GraphWarned():
                return event
            case RegionBuilt() | GraphStarted() | StackEvaluated() | LeftoverRemoved():
                return None  # for users of a single graph
            case _:
                assert_never(event)

    def _reap(self, state: _WorkerState, reason: str) -> None:
        """Remove a worker that is lost, and end what it was making, for the observer."""
        del self._states[state.handle.worker.name]
        state.handle.kill()
        self._observer.notify(WorkerPrepares(state.handle.worker.name, None))
        if state.scene is not None:
            self._observer.notify(SceneEnded(state.scene, None))
        if not state.is_ready and state.entry is None:
            self._failed_starts += 1
            if self._failed_starts >= _MAX_FAILED_STARTS:
                raise GraphError(f"{self._failed_starts} workers were lost as they started; the last one: {reason}")
