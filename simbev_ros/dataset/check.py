"""Whether a dataset's index and its bags say the same."""

from collections.abc import Iterator
from pathlib import Path

from simbev_ros.dataset.index import INDEX_FILE, read_index, sha256_of
from simbev_ros.dataset.staging import staging_of
from simbev_ros.errors import BagError, InputError
from simbev_ros.recording.layout import is_scene, locate_mcap, scenes_of
from simbev_ros.recording.verify import Fault


def index_faults(dataset: Path) -> list[Fault]:
    """What is wrong with a dataset besides what is wrong within its bags; of one without an index, nothing."""
    if not (dataset / INDEX_FILE).exists():
        return []
    try:
        rows = {dataset / row["path"]: row for row in read_index(dataset)}
    except InputError as error:
        return [Fault(dataset, INDEX_FILE, str(error))]
    faults = [Fault(bag, place, problem) for bag, row in rows.items() for place, problem in _row_faults(bag, row)]
    bags = [bag for bag in scenes_of(dataset) if is_scene(bag)]
    faults += [Fault(bag, INDEX_FILE, "the index does not have this scene") for bag in bags if bag not in rows]
    if staging_of(dataset).exists():
        faults.append(Fault(dataset, staging_of(dataset).name, "a scene was being made; generate makes it again"))
    return faults


def _row_faults(bag: Path, row: dict[str, object]) -> Iterator[tuple[str, str]]:
    """Whether a bag is there, and is the one that the index knows."""
    try:
        file = locate_mcap(bag)
    except BagError:
        yield "", "the index has this scene, but it is not there"
        return
    if sha256_of(bag) != row["sha256"]:
        yield file.name, "it is not the file that the index knows: its SHA-256 is another"
