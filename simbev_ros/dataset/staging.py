"""Staging of new scenes: they are recorded in a folder of their own and moved into the dataset when they are complete.

An interruption at any moment leaves no half-finished scene in the dataset, and a scene that is being replaced stays
until its replacement is complete.
"""

import shutil
from pathlib import Path
from typing import overload

from simbev_ros.dataset.plan import PlannedEntry, bag_of
from simbev_ros.foundation.files.confined_paths import refuse_links_out
from simbev_ros.foundation.files.syncing import sync_names
from simbev_ros.foundation.object_store.object_path import AnyPath, ObjectPath
from simbev_ros.recording.layout import REPLACED_SUFFIX, SCENES_FOLDER, additional_bags

_STAGING_FOLDER = ".making"
ON_FULL_DISK = "finished scenes are in the dataset, nothing else is kept; given space, the same command makes the rest"
"""Consequence of a full disk while scenes are recorded in staging, for messages."""


def clean_up_staging(dataset: Path) -> None:
    """Clean up after an interrupted run: delete unfinished scenes and restore scenes whose replacement did not finish.

    Call it before new scenes are recorded.

    Raises:
        InputError: A link leads out of the dataset.
    """
    staging = staging_of(dataset)
    if staging.is_symlink():
        staging.unlink()  # scenes would be recorded where it leads to
    shutil.rmtree(staging, ignore_errors=True)
    refuse_links_out(dataset, SCENES_FOLDER)
    for old in (dataset / SCENES_FOLDER).glob(f"*/*{REPLACED_SUFFIX}"):
        bag = old.with_name(old.name.removesuffix(REPLACED_SUFFIX))
        if bag.exists():
            shutil.rmtree(old)
        else:
            _put_back(old, bag)


@overload
def staging_of(dataset: Path) -> Path: ...
@overload
def staging_of(dataset: ObjectPath) -> ObjectPath: ...
def staging_of(dataset: AnyPath) -> AnyPath:
    """Folder for unfinished scenes, or for folders of several workers: datasets of their own on the same disk."""
    return dataset / _STAGING_FOLDER


def move_into_dataset(dataset: Path, entry: PlannedEntry, staging: Path) -> None:
    """Move a recorded scene into the dataset, in place of an older one with its additional bags.

    Args:
        dataset: The dataset's folder.
        entry: The scene.
        staging: Folder on the same disk that it was recorded into, laid out like a dataset.
    """
    new, bag = bag_of(staging, entry), bag_of(dataset, entry)
    old = bag.with_name(bag.name + REPLACED_SUFFIX)
    bag.parent.mkdir(parents=True, exist_ok=True)
    if bag.exists():
        _put_away(bag, old)
    new.rename(bag)
    sync_names([bag])
    shutil.rmtree(old, ignore_errors=True)


def remove_from_dataset(dataset: Path, entry: PlannedEntry) -> None:
    """Remove a scene with its additional bags, if it exists; an interruption leaves all of it or nothing."""
    bag = bag_of(dataset, entry)
    old = bag.with_name(bag.name + REPLACED_SUFFIX)
    if bag.exists():
        _put_away(bag, old)
        shutil.rmtree(old)


def _put_away(bag: Path, old: Path) -> None:
    """Rename a scene that is being replaced, and move its additional bags into it, as they have its old motion."""
    bag.rename(old)
    for additional in additional_bags(bag).values():
        additional.rename(old / additional.name)


def _put_back(old: Path, bag: Path) -> None:
    """Undo ``_put_away``, however far it got."""
    for additional in [path for path in old.iterdir() if path.is_dir()]:
        additional.rename(bag.with_name(additional.name))
    old.rename(bag)
