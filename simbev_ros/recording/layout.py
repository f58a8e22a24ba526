"""File layout: names and paths of bags, finished and unfinished, of their files and attachments, and of datasets."""

import glob
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, overload

from simbev_ros.foundation.errors import BagError, InputError
from simbev_ros.foundation.files.confined_paths import path_inside, refuse_links_out
from simbev_ros.foundation.files.input_file import is_folder, path_exists
from simbev_ros.foundation.object_store.object_path import AnyPath, ObjectPath, require_bucket

INDEX_FILE = "index.parquet"
SCENES_FOLDER = "scenes"
PARTIAL_SUFFIX = ".partial"
SCENE_ATTACHMENT = "scene.json"
CONFIG_ATTACHMENT = "config.yaml"
MAP_ATTACHMENT = "map.xodr"
MAP_SOURCE_ATTACHMENT = "map_source.bz2"
"""Compressed source file of the map, for maps that are loaded from files."""
LEAD_IN_ATTACHMENT = "lead_in.json"
TRAJECTORIES_ATTACHMENT = "trajectories.npz"
"""Tracks of all actors; format in ``schema/trajectories.py``."""
METADATA_FILE = "metadata.yaml"
PACKED_SUFFIX = ".zstd"
REPLACED_SUFFIX = ".replaced"
"""Suffix of the folder of a scene that is being replaced."""

_SUFFIXES = (PARTIAL_SUFFIX, REPLACED_SUFFIX)
_LABEL = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,63}")
_SCENE = re.compile(r".+-\d{4,}")


def partial_of(bag: Path) -> Path:
    """Folder that a bag is written to until it is finished."""
    return bag.with_name(bag.name + PARTIAL_SUFFIX)


def mcap_in(bag: Path, name: str, number: int = 0) -> Path:
    """Path of an MCAP file in the bag folder of the scene called ``name``, finished or not; large bags have several."""
    return bag / f"{name}_{number}.mcap"


@overload
def locate_mcap(path: Path) -> Path: ...
@overload
def locate_mcap(path: ObjectPath) -> ObjectPath: ...
def locate_mcap(path: AnyPath) -> AnyPath:
    """First MCAP file of a bag, given by its folder or by an MCAP file.

    Raises:
        BagError: There is nothing at this path, or not the files of one bag.
    """
    return mcap_files(path)[0]


@overload
def mcap_files(path: Path) -> list[Path]: ...
@overload
def mcap_files(path: ObjectPath) -> list[ObjectPath]: ...
def mcap_files(path: AnyPath) -> list[Any]:
    """MCAP files of a bag in order, given by its folder or by an MCAP file.

    Raises:
        BagError: There is nothing at this path, or not the files of one bag.
    """
    files: dict[int, Any] = numbered_files(path)
    missing = [f"{_stem(files)}_{number}.mcap" for number in range(max(files)) if number not in files]
    if missing:
        raise BagError(f"{path}: {', '.join(missing)} is missing")
    return [file for number, file in sorted(files.items()) if number == 0 or file.stat().st_size]


@overload
def numbered_files(path: Path) -> dict[int, Path]: ...
@overload
def numbered_files(path: ObjectPath) -> dict[int, ObjectPath]: ...
def numbered_files(path: AnyPath) -> dict[int, Any]:
    """MCAP files of a bag by number; numbers may be missing.

    Raises:
        BagError: There is nothing at this path, or not the files of one bag.
        InputError: A file of the bag is a link that leads out of it.
    """
    if isinstance(path, ObjectPath):
        return {0: path} if path.suffix == ".mcap" else _numbered(path, _objects_in(path))
    if not path_exists(path):
        raise BagError(f"{path}: no such file or folder")
    if path.is_file():
        return {0: path}
    found = [file for file in path.glob("*.mcap") if file.is_file()]
    if not found:
        _refuse_other_forms(path)
    for name in (METADATA_FILE, *(file.name for file in found)):
        refuse_links_out(path, name)
    return _numbered(path, found)


def _refuse_other_forms(bag: Path) -> None:
    """Raise BagError if a folder holds a bag in a form of rosbag2 that cannot be read as it is."""
    if packed_files(bag):
        raise BagError(f"{bag}: rosbag2 has compressed its files as a whole; simbev repair {bag} unpacks them")
    if any(bag.glob("*.db3*")):
        raise BagError(
            f"{bag}: it is in SQLite form; rosbags-convert --src {bag} --dst {bag}-mcap --dst-storage mcap converts it"
        )


def packed_files(bag: Path) -> list[Path]:
    """MCAP files in a folder that rosbag2 has compressed as a whole."""
    return sorted(bag.glob(f"*.mcap{PACKED_SUFFIX}")) if is_folder(bag) else []


def _objects_in(bag: ObjectPath) -> list[ObjectPath]:
    """MCAP files in a folder of an object store. Raises BagError or StoreError if there is nothing."""
    found = list(bag.iterdir())
    if not found:
        require_bucket(bag)
        raise BagError(f"{bag}: there is no dataset and no bag: no {INDEX_FILE}, no .mcap file")
    return [file for file in found if file.suffix == ".mcap"]


def _numbered(folder: AnyPath, found: Sequence[AnyPath]) -> dict[int, AnyPath]:
    """MCAP files in a bag's folder by number. Raises BagError if they are not those of one bag."""
    if len(found) == 1 and not _NUMBERED.fullmatch(found[0].name):
        return {0: found[0]}
    files = {int(match[2]): file for file in found if (match := _NUMBERED.fullmatch(file.name))}
    if not found or len(files) != len(found) or len({_stem({0: file}) for file in files.values()}) != 1:
        if not found and isinstance(folder, Path) and is_folder(scenes_folder(folder)):
            example = next(iter(sorted(scenes_folder(folder).glob("*/*"))), scenes_folder(folder))
            raise BagError(f"{folder}: is a dataset; name one of its scenes, such as {example}")
        more = ", which are not parts of one" if found else f"; a dataset holds a folder {SCENES_FOLDER}"
        raise BagError(f"{folder}: a scene's bag holds one .mcap file, this folder holds {len(found)}{more}")
    return files


def _stem(files: Mapping[int, AnyPath]) -> str:
    """Name of the scene, from the names of its files."""
    return next(iter(files.values())).stem.rpartition("_")[0]


_NUMBERED = re.compile(r"(.+)_(\d+)\.mcap")


def bytes_of(bag: AnyPath) -> int:
    """Total size of a bag's MCAP files in bytes.

    Raises:
        BagError: There is no bag.
    """
    return sum(file.stat().st_size for file in mcap_files(bag))


@contextmanager
def read_errors(bag: AnyPath) -> Iterator[None]:
    """Turn errors of the operating system while a bag is read into ``BagError``.

    Raises:
        BagError: A file cannot be read.
    """
    try:
        yield
    except OSError as error:
        raise BagError(f"{bag}: cannot be read: {error.strerror or error}") from None


def scenes_folder(dataset: Path) -> Path:
    """Folder that contains a folder for each split; every dataset has it from the start."""
    return dataset / SCENES_FOLDER


@overload
def scene_folder(dataset: Path, split: str, name: str) -> Path: ...
@overload
def scene_folder(dataset: ObjectPath, split: str, name: str) -> ObjectPath: ...
def scene_folder(dataset: AnyPath, split: str, name: str) -> AnyPath:
    """Folder of a scene's finished bag in a dataset.

    Raises:
        InputError: The names, or links in the dataset, lead out of it.
    """
    if isinstance(dataset, ObjectPath):
        return dataset / SCENES_FOLDER / split / name
    return path_inside(dataset, Path(SCENES_FOLDER, split, name))


def dataset_of(bag: Path) -> Path | None:
    """The dataset that a bag's folder belongs to; None if it belongs to none."""
    dataset = bag.parent.parent.parent
    return dataset if bag.parent.parent == scenes_folder(dataset) else None


def additional_folder(bag: Path, label: str) -> Path:
    """Folder of an additional bag with the motion of a scene, next to the scene's own bag.

    Raises:
        InputError: The label is not allowed in a folder's name.
    """
    if not _LABEL.fullmatch(label) or f".{label}" in _SUFFIXES:
        taken = ", ".join(suffix[1:] for suffix in _SUFFIXES)
        raise InputError(
            f"label {label!r}: allowed are a letter, then up to 63 letters, digits and underscores; not {taken}"
        )
    return bag.with_name(f"{bag.name}.{label}")


@overload
def additional_bags(bag: Path) -> dict[str, Path]: ...
@overload
def additional_bags(bag: ObjectPath) -> dict[str, ObjectPath]: ...
def additional_bags(bag: AnyPath) -> dict[str, Any]:
    """Finished additional bags of a scene by label."""
    found: list[Any] = [*bag.parent.glob(f"{glob.escape(bag.name)}.*")]
    return {path.suffix[1:]: path for path in sorted(found) if _is_additional(path)}


def _is_additional(path: AnyPath) -> bool:
    return _LABEL.fullmatch(path.suffix[1:]) is not None and path.suffix not in _SUFFIXES


def is_scene(bag: AnyPath) -> bool:
    """Whether a folder is the finished own bag of a scene, neither an additional nor an unfinished one."""
    return _SCENE.fullmatch(bag.name) is not None


def is_dataset(path: AnyPath) -> bool:
    """Whether a path is a dataset's folder; in an object store, the index makes it one."""
    if isinstance(path, ObjectPath):
        return path.suffix != ".mcap" and (path / INDEX_FILE).is_file()
    return is_folder(scenes_folder(path))


def require_dataset(path: AnyPath) -> None:
    """Check that there is a dataset.

    Raises:
        InputError: There is none, or its object store cannot be reached or refuses access.
    """
    if is_dataset(path):
        return
    if isinstance(path, ObjectPath):
        require_bucket(path)
        raise InputError(f"{path}: there is no dataset")
    raise InputError(f"{path}: {'is not a dataset' if path_exists(path) else 'no such file or folder'}")


def scenes_of(dataset: Path) -> list[Path]:
    """Bags of a dataset, finished and unfinished, as ``scenes/<split>/<scene>``, sorted by name.

    Raises:
        InputError: A link leads out of the dataset.
    """
    refuse_links_out(dataset, SCENES_FOLDER)
    return sorted({path.parent for path in scenes_folder(dataset).glob("*/*/*.mcap")})


def finished_scenes(dataset: Path) -> dict[Path, dict[str, Path]]:
    """Finished own bags of a dataset's scenes, sorted by name, each with its additional bags by label.

    Raises:
        InputError: A link leads out of the dataset.
    """
    bags = scenes_of(dataset)
    found: dict[Path, dict[str, Path]] = {bag: {} for bag in bags if is_scene(bag)}
    for bag in bags:
        if (own := bag.with_suffix("")) in found and _is_additional(bag):
            found[own][bag.suffix[1:]] = bag
    return found
