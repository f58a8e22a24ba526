"""The content of datasets in stores and folders, without logs, and the death of a driver."""

from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path

from simbev_ros.foundation.object_store.object_path import ObjectPath
from simbev_ros.foundation.object_store.transfers import list_objects


class Killed(BaseException):
    """The driver was killed: nothing of it can write any more."""


DieAfter = Callable[[int], AbstractContextManager[None]]


def objects(dataset: ObjectPath) -> dict[str, bytes]:
    """Content of the objects of a dataset by key."""
    found = {str(path.relative_to(dataset)): path.read_bytes() for path in list_objects(dataset)}
    return {key: content for key, content in found.items() if not key.startswith("logs/")}


def files(dataset: Path) -> dict[str, bytes]:
    """Content of the files of a dataset by path."""
    found = {str(path.relative_to(dataset)): path.read_bytes() for path in dataset.rglob("*") if path.is_file()}
    return {key: content for key, content in found.items() if not key.startswith("logs/")}
