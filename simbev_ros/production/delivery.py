"""The way of finished bags from the machine that made them to where the driver of a dataset finds them."""

from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from simbev_ros.dataset.plan import PlannedEntry


class Delivery(Protocol):
    """Takes a finished bag from the machine that made it to where the driver of the dataset finds it."""

    def deliver(self, bag: Path, entry: PlannedEntry) -> None:
        """Copy or move a bag.

        Raises:
            SimbevError: It could not be delivered.
        """


Deliveries = Callable[[str], Delivery | None]
"""The delivery for a worker, by its name; None: bags stay in the worker's folder."""


def keep_bags(worker: str) -> None:
    """No delivery for any worker."""
