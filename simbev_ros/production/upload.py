"""Interface of uploaders, which bring finished bags from the machine that made them to the dataset's storage."""

from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from simbev_ros.dataset.plan import PlannedEntry


class Uploader(Protocol):
    """Uploads finished bags to where the driver of the dataset finds them."""

    def upload(self, bag: Path, entry: PlannedEntry) -> None:
        """Upload a bag.

        Raises:
            SimbevError: It could not be uploaded.
        """


UploaderFactory = Callable[[str], Uploader | None]
"""The uploader for a worker, by its name; None: bags stay in the worker's folder."""


def no_upload(worker: str) -> None:
    """Return None: the worker's bags are not uploaded."""
