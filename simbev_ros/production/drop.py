"""Dropping scenes from a dataset for good: the core of ``simbev drop``."""

from contextlib import closing

from simbev_ros.dataset.plan import Plan, PlannedEntry
from simbev_ros.foundation.object_store.object_path import AnyPath, path_or_url
from simbev_ros.production.dataset import Numbers
from simbev_ros.production.dataset_storage import lock_dataset, open_storage
from simbev_ros.recording.layout import require_dataset


def drop_scenes(dataset: AnyPath | str, numbers: Numbers) -> list[PlannedEntry]:
    """Remove scenes, with their additional bags and rows of the index; return them, by ascending number.

    Their numbers are never used again. ``make_dataset`` then makes a new scene for each of them, with a new number.
    Interrupted, the same call drops what is left. Logs stay.

    Args:
        dataset: The dataset: a folder, or ``s3://bucket/prefix`` in an object store.
        numbers: Numbers of the scenes, single or as ranges.

    Raises:
        InputError: There is no dataset or no such scene, another process writes into the dataset, or it cannot be
            written to.
    """
    dataset = path_or_url(dataset)
    require_dataset(dataset)
    ranges = [number if isinstance(number, range) else range(number, number + 1) for number in numbers]
    with lock_dataset(dataset) as lock:
        plan = Plan.load(dataset)
        dropped = plan.with_entries(plan.dropped).entries_with_numbers(ranges, None)
        plan = plan.without(dropped)
        plan.save(dataset)
        with closing(open_storage(dataset, lock, plan.finished_entries(dataset), min_free_bytes=0)) as storage:
            for entry in dropped:
                storage.remove(entry)
    return dropped
