"""The folder that one graph records replays into: a dataset, or the staging folder of the one that gets the bags."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from simbev_ros.dataset.staging import ON_FULL_DISK, clean_up_staging, staging_of
from simbev_ros.production.dataset_storage import lock_dataset
from simbev_ros.production.record_folder import keep_recorded
from simbev_ros.production.replay.selection import require_mergeable
from simbev_ros.recording.bag_files import disk_error_consequence


@contextmanager
def lock_replay_target(out: Path | None, folders: Sequence[Path], label: str | None) -> Iterator[Path | None]:
    """The folder that one graph records replays into, None if there is none.

    If the bags get a label, it is the folder for unfinished scenes of the dataset that contains them all, which is held
    meanwhile.

    Args:
        out: Dataset to record into; None: nothing is recorded there.
        folders: Folders of the bags to replay.
        label: Label of the additional bags to record instead; None: none.

    Raises:
        DiskError: The disk is full, or nearly; the message says what was kept.
        InputError: The bags cannot get additional bags with this label, or another process writes into their dataset.
    """
    if label is None:
        with keep_recorded(out):
            yield out
        return
    dataset = require_mergeable(folders, label)
    with lock_dataset(dataset), disk_error_consequence(ON_FULL_DISK):
        try:
            yield staging_of(dataset)
        finally:
            clean_up_staging(dataset)
