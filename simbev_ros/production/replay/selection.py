"""Selects the bags to replay: the bags and datasets that a user names, without the scenes that are recorded already."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from simbev_ros.foundation.errors import InputError
from simbev_ros.recording.layout import (
    additional_folder,
    dataset_of,
    is_dataset,
    is_scene,
    locate_mcap,
    scene_folder,
    scenes_of,
)


@dataclass(frozen=True, slots=True)
class Selection:
    """The bags to replay.

    Attributes:
        bags: They, as folders or MCAP files.
        recorded: Replays that exist already.
    """

    bags: list[Path]
    recorded: list[Path]


def select_bags(paths: Sequence[Path], out: Path | None, label: str | None) -> Selection:
    """The bags among some paths, and the scenes of the datasets among them without a recorded replay.

    Args:
        paths: Bags, their MCAP files, or datasets.
        out: Dataset to record into; None: none.
        label: Label of the additional bags to record instead; None: none.

    Raises:
        InputError: A dataset has no finished scene.
    """
    bags: list[Path] = []
    recorded: dict[Path, Path] = {}
    for path in paths:
        if not is_dataset(path):
            bags.append(path)
            continue
        scenes = _finished_scenes(path)
        bags += scenes
        recorded |= {
            bag: replay for bag in scenes if (replay := _replay_of(bag, out, label)) is not None and replay.exists()
        }
    return Selection([bag for bag in bags if bag not in recorded], list(recorded.values()))


def folder_of(bag: Path) -> Path:
    """Folder of a bag that is given by its folder or by an MCAP file; links are resolved.

    Raises:
        BagError: There is no bag.
    """
    return locate_mcap(bag).resolve().parent


def require_mergeable(folders: Sequence[Path], label: str) -> Path:
    """Check that scenes can get an additional bag.

    Args:
        folders: Folders of the scenes' own bags, at least one.
        label: Label of the additional bags.

    Returns:
        The dataset that contains them all.

    Raises:
        InputError: A bag is not in the same dataset as the first one, or has an additional bag with this label.
    """
    dataset = dataset_of(folders[0])
    for folder in folders:
        if not is_scene(folder) or dataset_of(folder) is None or dataset_of(folder) != dataset:
            raise InputError(f"{folder}: is not a finished scene of the dataset that gets the bags", parameter="merge")
        if additional_folder(folder, label).exists():
            raise InputError(f"{additional_folder(folder, label)}: exists already; nothing was overwritten")
    assert dataset is not None, "checked above"
    return dataset


def _finished_scenes(dataset: Path) -> list[Path]:
    """The finished scenes of a dataset. Raises InputError if it has none."""
    bags = [bag for bag in scenes_of(dataset) if is_scene(bag)]
    if not bags:
        raise InputError(f"{dataset}: there is no finished scene to replay")
    return bags


def _replay_of(bag: Path, out: Path | None, label: str | None) -> Path | None:
    """Folder that the replay of a dataset's scene gets; None: it is not recorded."""
    if label is not None:
        return additional_folder(bag, label)
    return None if out is None else scene_folder(out, bag.parent.name, bag.name)
