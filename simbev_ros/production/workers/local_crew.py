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
from simbev_ros.production.delivery import Deliveries, keep_bags
from simbev_ros.production.observer import SILENT, ProductionObserver
from simbev_ros.production.scene_ending import MadeScene
from simbev_ros.production.workers.crew import Worker
from simbev_ros.production.workers.local_worker import LocalWorker
from simbev_ros.production.workers.machine_capacity import fitting_workers, share_gpus
from simbev_ros.production.workers.messages import Settings
from simbev_ros.production.workers.team import Team

_POLL_S = 0.5
"""Maximum time between two looks for workers that have fallen silent."""
THIS_MACHINE = "this machine"


@dataclass(slots=True)
class _Seat:
    """The devices that a worker renders on, None: as configured; and its name."""

    rendering: Rendering | None
    worker: str = ""


class LocalCrew(Team):
    """Processes that make scenes side by side, each on a graph in a ROS domain of its own.

    Args:
        scenario: The configuration.
        staging: Folder for unfinished scenes; each worker has a folder in it.
        workers: Number of workers; ``auto``: as many as the machine carries, once one of them has made a scene.
        scenes: Number of scenes to make; there are never more workers.
        observer: Receives the progress.
        delivery_of: Deliveries of finished bags.

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
        delivery_of: Deliveries = keep_bags,
    ) -> None:
        super().__init__(observer)
        self._scenario, self._staging, self._scenes = scenario, staging, scenes
        self._delivery_of = delivery_of
        self._chosen_by_cost = workers == "auto"
        self._numbers = count(1)
        self._seats: list[_Seat] = []
        self._divide(1 if workers == "auto" else workers)

    def _divide(self, workers: int) -> None:
        """Make seats for a number of workers; those that would render on other devices leave when they are idle."""
        before = {seat.worker: seat.rendering for seat in self._seats}
        self._seats = []
        for rendering in share_gpus(max(min(workers, self._scenes), 1), self._scenario):
            kept = next((name for name, devices in before.items() if devices == rendering), "")
            before.pop(kept, None)
            self._seats.append(_Seat(rendering, kept))

    def idle(self) -> Sequence[Worker]:
        """Workers that have a seat and wait for a scene."""
        seated = {seat.worker for seat in self._seats}
        return [worker for worker in super().idle() if worker.name in seated]

    def _replenish(self) -> None:
        seated, waiting = {seat.worker for seat in self._seats}, super().idle()
        for handle in self._handles:
            if handle.worker.name not in seated and handle.worker in waiting:
                self._dismiss(handle)
        present = {handle.worker.name for handle in self._handles}
        for seat in self._seats:
            if seat.worker not in present:
                seat.worker = self._start_worker(seat.rendering)

    def _start_worker(self, rendering: Rendering | None) -> str:
        worker = Worker(f"worker-{next(self._numbers)}", THIS_MACHINE)
        folder, delivery = self._staging / worker.name, self._delivery_of(worker.name)
        settings = Settings(self._scenario, folder, rendering=rendering, delivery=delivery)
        self._hire(LocalWorker(worker, settings))
        return worker.name

    def _learn(self, scene: MadeScene) -> None:
        """Choose the number of workers by the cost of the first scene."""
        if self._chosen_by_cost:
            self._chosen_by_cost = False
            workers = min(fitting_workers(scene.cost, usable_cores()), self._scenes - 1)
            if workers > 1:
                self._divide(workers)
            self._observer.workers_chosen(len(self._seats), scene.cost)

    def _pause(self, timeout_s: float) -> None:
        connections = [handle.connection for handle in self._handles if isinstance(handle, LocalWorker)]
        wait(connections, min(timeout_s, _POLL_S))
