"""Scenes are made beside the dataset's own and moved into their places when they are whole.

So an end at any moment leaves nothing half-done among them, and a scene is there until its replacement is.
"""

import shutil
from pathlib import Path

from simbev_ros.dataset.plan import PlannedEntry, bag_of
from simbev_ros.recording.layout import REPLACED_SUFFIX, additional_bags
from simbev_ros.recording.mcap.syncing import sync_names

_STAGING_FOLDER = ".making"


def clean_up(dataset: Path) -> None:
    """Put in order what an earlier end, however sudden, has left: unfinished scenes go, replaced ones come back."""
    shutil.rmtree(dataset / _STAGING_FOLDER, ignore_errors=True)
    for old in (dataset / "scenes").glob(f"*/*{REPLACED_SUFFIX}"):
        place = old.with_name(old.name.removesuffix(REPLACED_SUFFIX))
        if place.exists():
            shutil.rmtree(old)
        else:
            _put_back(old, place)


def staging_of(dataset: Path) -> Path:
    """Where scenes are made: a dataset of its own on the same disk."""
    return dataset / _STAGING_FOLDER


def move_in(dataset: Path, entry: PlannedEntry) -> Path:
    """Give a scene that has been made its place; one that is there already is removed, with its additional bags."""
    new, place = bag_of(staging_of(dataset), entry), bag_of(dataset, entry)
    old = place.with_name(place.name + REPLACED_SUFFIX)
    place.parent.mkdir(parents=True, exist_ok=True)
    if place.exists():
        _put_away(place, old)
    new.rename(place)
    sync_names([place])
    shutil.rmtree(old, ignore_errors=True)
    return place


def _put_away(place: Path, old: Path) -> None:
    """Rename a scene that is being replaced, and move its additional bags into it: their motion is that of the old."""
    place.rename(old)
    for additional in additional_bags(place).values():
        additional.rename(old / additional.name)


def _put_back(old: Path, place: Path) -> None:
    """Undo ``_put_away``, wherever it was ended."""
    for additional in [path for path in old.iterdir() if path.is_dir()]:
        additional.rename(place.with_name(additional.name))
    old.rename(place)
