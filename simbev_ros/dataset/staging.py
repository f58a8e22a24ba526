"""Scenes are made beside the dataset's own and moved into their places when they are whole.

So an end at any moment leaves nothing half-done among them, and a scene is there until its replacement is.
"""

import shutil
from pathlib import Path

from simbev_ros.dataset.plan import PlannedEntry, bag_of
from simbev_ros.recording.layout import REPLACED_SUFFIX, additional_bags

_STAGING_FOLDER = ".making"


def clean_up(dataset: Path) -> None:
    """Put in order what an earlier end, however sudden, has left: unfinished scenes go, replaced ones come back."""
    shutil.rmtree(dataset / _STAGING_FOLDER, ignore_errors=True)
    for old in (dataset / "scenes").glob(f"*/*{REPLACED_SUFFIX}"):
        folder = old.with_name(old.name.removesuffix(REPLACED_SUFFIX))
        if folder.exists():
            shutil.rmtree(old)
        else:
            old.rename(folder)


def staging_of(dataset: Path) -> Path:
    """Where scenes are made: a dataset of its own on the same disk."""
    return dataset / _STAGING_FOLDER


def move_in(dataset: Path, entry: PlannedEntry) -> Path:
    """Give a scene that has been made its place; one that is there already is removed, with its additional bags."""
    new, place = bag_of(staging_of(dataset), entry), bag_of(dataset, entry)
    old = place.with_name(place.name + REPLACED_SUFFIX)
    place.parent.mkdir(parents=True, exist_ok=True)
    if place.exists():
        place.rename(old)
        for additional in additional_bags(place).values():  # their motion is that of the old one
            shutil.rmtree(additional)
    new.rename(place)
    shutil.rmtree(old, ignore_errors=True)
    return place
