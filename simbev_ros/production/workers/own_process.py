"""The crew of one that makes scenes in the driver's process."""

from collections.abc import Sequence
from pathlib import Path
from typing import Self

from simbev_ros.config.scenario import Scenario
from simbev_ros.dataset.plan import PlannedEntry
from simbev_ros.production.delivery import Deliveries, keep_bags
from simbev_ros.production.observer import SILENT, ProductionObserver
from simbev_ros.production.scene_ending import SceneEnding
from simbev_ros.production.scene_maker import SceneMaker
from simbev_ros.production.workers.crew import Worker


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
