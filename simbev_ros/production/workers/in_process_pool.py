"""A pool with one worker: the driver's process."""

from collections.abc import Sequence
from pathlib import Path
from typing import Self

from simbev_ros.config.scenario import Scenario
from simbev_ros.dataset.plan import PlannedEntry
from simbev_ros.production.observer import SILENT, ProductionObserver
from simbev_ros.production.scene_ending import SceneEnding
from simbev_ros.production.scene_maker import SceneMaker
from simbev_ros.production.upload import UploaderFactory, no_upload
from simbev_ros.production.workers.worker_pool import Worker


class InProcessPool:
    """Pool of one worker: the calling process, which makes a scene while the driver waits for it."""

    machines = 1

    def __init__(
        self,
        scenario: Scenario,
        staging: Path,
        observer: ProductionObserver = SILENT,
        uploader_for: UploaderFactory = no_upload,
    ) -> None:
        self._worker = worker = Worker("own", "this machine")
        uploader = uploader_for(worker.name)
        self._maker = SceneMaker(scenario, staging / worker.name, observer, uploader=uploader)
        self._entry: PlannedEntry | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._maker.close()

    def idle(self) -> Sequence[Worker]:
        """This process, unless it has been given a scene."""
        return [] if self._entry else [self._worker]

    def submit(self, worker: Worker, entry: PlannedEntry) -> None:
        """Note the scene to make."""
        self._entry = entry

    def wait(self, timeout_s: float) -> list[tuple[Worker, PlannedEntry, SceneEnding]]:
        """Make the scene, however long it takes."""
        entry, self._entry = self._entry, None
        return [] if entry is None else [(self._worker, entry, self._maker.make(entry))]
