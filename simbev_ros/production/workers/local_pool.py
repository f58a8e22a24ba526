"""Several workers on this machine, which share its cores and take turns on its GPUs."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import count
from multiprocessing.connection import wait
from pathlib import Path
from typing import Literal

from simbev_ros.config.rendering import Rendering
from simbev_ros.config.scenario import Scenario
from simbev_ros.foundation.threads import usable_cores
from simbev_ros.production.events import WorkersChosen
from simbev_ros.production.observer import SILENT, ProductionObserver
from simbev_ros.production.scene_ending import MadeScene
from simbev_ros.production.upload import UploaderFactory, no_upload
from simbev_ros.production.workers.local_worker import LocalWorker
from simbev_ros.production.workers.machine_capacity import cores_of_worker, fitting_workers, share_gpus
from simbev_ros.production.workers.messages import Settings
from simbev_ros.production.workers.supervised_pool import SupervisedPool
from simbev_ros.production.workers.worker_pool import Worker

_POLL_S = 0.5
"""Maximum time between two looks for workers that have fallen silent."""
THIS_MACHINE = "this machine"


@dataclass(slots=True)
class _Slot:
    """The devices that a worker renders on, None: as configured; the number of cores that it plans with; its name."""

    rendering: Rendering | None
    cores: int
    worker: str = ""


class LocalPool(SupervisedPool):
    """Processes that make scenes side by side, each on a graph in a ROS domain of its own.

    Args:
        scenario: The configuration.
        staging: Folder for unfinished scenes; each worker has a folder in it.
        workers: Number of workers; ``auto``: as many as the machine carries, once one of them has made a scene.
        scenes: Number of scenes to make; there are never more workers.
        observer: Receives the progress.
        uploader_for: Uploaders of finished bags.

    Raises:
        RenderError: There are several workers, but EGL is missing.
    """

    machines = 1

    def __init__(
        self,
        scenario: Scenario,
        staging: Path,
        workers: int | Literal["auto"],
        scenes: int,
        observer: ProductionObserver = SILENT,
        uploader_for: UploaderFactory = no_upload,
    ) -> None:
        super().__init__(observer)
        self._scenario, self._staging, self._scenes = scenario, staging, scenes
        self._uploader_for = uploader_for
        self._chosen_by_cost = workers == "auto"
        self._numbers = count(1)
        self._slots: list[_Slot] = []
        self._resize(1 if workers == "auto" else workers)

    def _resize(self, workers: int) -> None:
        """Make slots for a number of workers; those on other devices are stopped when they are idle."""
        before = {slot.worker: slot.rendering for slot in self._slots}
        self._slots = []
        workers = max(min(workers, self._scenes), 1)
        cores = cores_of_worker(workers, usable_cores())
        for rendering in share_gpus(workers, self._scenario):
            kept = next((name for name, devices in before.items() if devices == rendering), "")
            before.pop(kept, None)
            self._slots.append(_Slot(rendering, cores, kept))

    def idle(self) -> Sequence[Worker]:
        """Workers that have a slot and wait for a scene."""
        assigned = {slot.worker for slot in self._slots}
        return [worker for worker in super().idle() if worker.name in assigned]

    def _scale(self) -> None:
        assigned, waiting = {slot.worker for slot in self._slots}, super().idle()
        for handle in self._handles:
            if handle.worker.name not in assigned and handle.worker in waiting:
                self._stop_worker(handle)
        present = {handle.worker.name for handle in self._handles}
        for slot in self._slots:
            if slot.worker not in present:
                slot.worker = self._start_worker(slot.rendering, slot.cores)

    def _start_worker(self, rendering: Rendering | None, cores: int) -> str:
        worker = Worker(f"worker-{next(self._numbers)}", THIS_MACHINE)
        folder, uploader = self._staging / worker.name, self._uploader_for(worker.name)
        settings = Settings(self._scenario, folder, rendering=rendering, uploader=uploader)
        self._add_worker(LocalWorker(worker, settings, cores))
        return worker.name

    def _record_cost(self, scene: MadeScene) -> None:
        """Choose the number of workers by the cost of the first scene."""
        if self._chosen_by_cost:
            self._chosen_by_cost = False
            workers = min(fitting_workers(scene.cost, usable_cores()), self._scenes - 1)
            if workers > 1:
                self._resize(workers)
            self._observer.notify(WorkersChosen(len(self._slots), scene.cost))

    def _pause(self, timeout_s: float) -> None:
        connections = [handle.connection for handle in self._handles if isinstance(handle, LocalWorker)]
        wait(connections, min(timeout_s, _POLL_S))
