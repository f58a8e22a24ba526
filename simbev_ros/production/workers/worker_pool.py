"""The interface between the driver of a dataset and the workers that make its scenes.

The driver assigns scenes to idle workers and collects how they ended. It alone decides about retries and writes into
the dataset; workers write into folders of their own. The pools are in ``in_process_pool``, ``local_pool`` and
``ray_worker_pool``.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, Self

from simbev_ros.dataset.plan import PlannedEntry
from simbev_ros.production.scene_ending import SceneEnding


@dataclass(frozen=True, slots=True)
class Worker:
    """A worker as the driver sees it.

    Attributes:
        name: Name of the worker, which no other one has had; also the name of its folder for unfinished scenes.
        machine: Machine that it runs on.
    """

    name: str
    machine: str


class WorkerPool(Protocol):
    """Workers, of which each makes one scene at a time. As a context manager it ends them all."""

    def __enter__(self) -> Self:
        """Begin to start workers."""

    def __exit__(self, *_: object) -> None:
        """End all workers; nothing of them is left."""

    def idle(self) -> Sequence[Worker]:
        """Workers that wait for a scene."""

    def submit(self, worker: Worker, entry: PlannedEntry) -> None:
        """Assign a scene to an idle worker."""

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
