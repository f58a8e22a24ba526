"""Checks of a dataset as a whole: whether its index matches its bags, and whether scenes are missing or unfinished."""

from collections.abc import Iterator
from functools import partial
from pathlib import Path

from simbev_ros.dataset.index import read_index
from simbev_ros.dataset.index_row import Row, index_row, sha256_of
from simbev_ros.dataset.parallel import OWN_PROCESS, Pool
from simbev_ros.dataset.plan import PLAN_FILE, Plan
from simbev_ros.dataset.staging import staging_of
from simbev_ros.foundation.errors import BagError, InputError
from simbev_ros.foundation.object_store.connection import StoreError
from simbev_ros.foundation.object_store.object_path import AnyPath
from simbev_ros.recording.layout import INDEX_FILE, is_scene, mcap_files, scenes_of
from simbev_ros.recording.verify import Fault

_NOT_FROM_BAG = ("simbev_ros",)
"""Index columns that do not depend on the bag: the version that wrote the row."""


def dataset_faults(dataset: Path, pool: Pool = OWN_PROCESS) -> list[Fault]:
    """Faults of a dataset other than those within its bags, which ``recording.verify`` finds.

    A dataset that was recorded scene by scene need not have an index.

    Args:
        dataset: The dataset's folder.
        pool: Workers that read bags.
    """
    bags = [bag for bag in scenes_of(dataset) if is_scene(bag)]
    empty = sorted(bag for bag in dataset.glob("scenes/*/*") if is_scene(bag) and bag.is_dir() and bag not in bags)
    faults = [Fault(bag, "", "there is no .mcap file in it") for bag in empty]
    if staging_of(dataset).exists():
        faults.append(Fault(dataset, staging_of(dataset).name, "a scene was interrupted; generate records it again"))
    faults += plan_faults(dataset)
    if not (dataset / INDEX_FILE).exists():
        if bags and (dataset / PLAN_FILE).exists():
            faults.append(Fault(dataset, INDEX_FILE, "it is missing; generate rebuilds it"))
        return faults
    try:
        rows = {dataset / row["path"]: row for row in read_index(dataset)}
    except InputError as error:
        return [*faults, Fault(dataset, INDEX_FILE, str(error).removeprefix(f"{dataset / INDEX_FILE}: "))]
    indexed = {bag: row for bag, row in rows.items() if bag not in empty}
    found = pool.map(partial(row_faults, dataset), [*indexed.values()])
    faults += [Fault(bag, *fault) for bag, each in zip(indexed, found, strict=True) for fault in each]
    faults += [Fault(bag, INDEX_FILE, "the index does not list this scene") for bag in bags if bag not in rows]
    return faults


def plan_faults(dataset: AnyPath) -> list[Fault]:
    """Faults of a dataset's plan. Raises StoreError if an object store does not give it out."""
    try:
        Plan.load(dataset)
    except StoreError:
        raise
    except InputError as error:
        return [Fault(dataset, PLAN_FILE, str(error).removeprefix(f"{dataset / PLAN_FILE}: "))]
    return []


def row_faults(dataset: Path, row: Row) -> list[tuple[str, str]]:
    """Place and problem of each difference between a row of the index and the bag that it describes."""
    return list(_differences(dataset, row))


def _differences(dataset: Path, row: Row) -> Iterator[tuple[str, str]]:
    bag = dataset / row["path"]
    if not bag.exists():
        yield "", "the index lists this scene, but its bag is missing"
        return
    try:
        if sha256_of(bag) != row["sha256"]:
            yield mcap_files(bag)[0].name, "it is not the file in the index: its SHA-256 differs"
            return
        known = index_row(bag, dataset)
    except BagError as error:
        yield "", str(error).removeprefix(f"{bag}: ")
        return
    for name in sorted(known.keys() - _NOT_FROM_BAG):
        if row[name] != known[name]:
            yield INDEX_FILE, f"{name} is {row[name]!r}, but {known[name]!r} in the bag"
