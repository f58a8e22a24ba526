"""Exports a dataset to the layout of SimBEV, for training code that was written for it.

The work is divided into parts of some frames of a scene, which can be made in any order and in many processes. A part
is recorded as finished when all its files are on the disk; an interrupted export resumes with the parts that are not.
Each file gets its name only when it is complete, and the info files are written last.
"""

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from simbev_ros.dataset import Dataset, Scene, open_dataset
from simbev_ros.errors import InputError
from simbev_ros.export.simbev.channels import channels, left_out
from simbev_ros.export.simbev.infos import frame_info, metadata, scene_info
from simbev_ros.recording.layout import CONFIG_ATTACHMENT, bytes_of, locate_mcap
from simbev_ros.recording.mcap.syncing import sync, sync_names
from simbev_ros.recording.reader import SceneBag

ROOT = "simbev"
_PARTS_FOLDER = ".parts"
_FRAMES_PER_PART = 20


@dataclass(frozen=True, slots=True)
class Part:
    """Some consecutive frames of a scene, small enough to be sent to another process.

    Attributes:
        dataset: Path of the dataset.
        root: Root folder of the layout.
        scene: Name of the scene.
        number: Number of the scene.
        first: Index of the first frame.
        count: Number of frames.
        source: Fingerprint of the scene's bags.
    """

    dataset: Path
    root: Path
    scene: str
    number: int
    first: int
    count: int
    source: str

    @property
    def record_path(self) -> Path:
        """Path of the part's record."""
        return self.root / _PARTS_FOLDER / f"scene_{self.number:04d}-{self.first:06d}.json"

    def record(self) -> dict[str, Any] | None:
        """The record of the part; None if it has yet to be made."""
        try:
            record: dict[str, Any] = json.loads(self.record_path.read_bytes())
        except (OSError, ValueError):
            return None
        return record if (record["source"], record["count"]) == (self.source, self.count) else None


def parts_of(dataset: Dataset, root: Path) -> list[Part]:
    """All parts of a dataset, finished or not.

    Raises:
        InputError: There is nothing to export, or the sensors of scenes differ, which the layout cannot express.
        BagError: A bag cannot be read.
    """
    parts = []
    for scene in dataset.scenes:
        if metadata(scene) != metadata(dataset.scenes[0]):
            first = dataset.scenes[0].path
            raise InputError(f"{scene.path}: its sensors are not those of {first}, and the layout knows one rig")
        source = f"{scene.name} {scene.split} {_fingerprint(scene)}"
        for first_frame in range(0, len(scene), _FRAMES_PER_PART):
            count = min(_FRAMES_PER_PART, len(scene) - first_frame)
            parts.append(Part(dataset.path, root, scene.name, scene.number, first_frame, count, source))
    if not parts:
        raise InputError(f"{dataset.path}: it has no finished scene to export")
    return parts


def remove_replaced(parts: Iterable[Part]) -> None:
    """Remove the files and records of scenes whose bags have been replaced, before parts are made."""
    sources = {part.number: (part.root, part.source) for part in parts}
    for number, (root, source) in sources.items():
        records = sorted((root / _PARTS_FOLDER).glob(f"scene_{number:04d}-*.json"))
        if any(json.loads(record.read_bytes())["source"] != source for record in records):
            for file in (*root.glob(f"*/*/SimBEV-scene-{number:04d}-frame-*"), *records):
                file.unlink()


def make_part(part: Part) -> int:
    """Write the files of a part, then its record.

    Returns:
        The number of its frames.

    Raises:
        InputError: A file cannot be written.
        BagError: The bag is damaged.
    """
    scene = _open_scene(part.dataset, part.scene, part.source)
    made = channels(scene)
    frames, written = [], []
    for frame in scene[part.first : part.first + part.count]:
        if "odom" not in frame:
            continue  # end of a truncated bag
        files = {c.name: c.path(part.number, frame.tick) for c in made if all(key in frame for key in c.keys)}
        for channel in made:
            if channel.name in files:
                written.append(write_whole(part.root / files[channel.name], [channel.encode(frame)]))
        frames.append({**frame_info(frame), "files": files})
    _sync(written)
    record = {"source": part.source, "count": part.count, "frames": frames}
    _sync([write_whole(part.record_path, [_json(record)])])
    return part.count


def finish(dataset: Dataset, parts: Sequence[Part]) -> list[str]:
    """Write info files, configurations and logs, once all parts are made.

    Returns:
        Lines of text that name what is missing in the layout.

    Raises:
        InputError: A part has no record, or a file cannot be written.
    """
    root, first, written = parts[0].root, dataset.scenes[0], list[Path]()
    parts_of_scene: dict[str, list[Part]] = {}
    for part in parts:
        parts_of_scene.setdefault(part.scene, []).append(part)
    for split in sorted({scene.split for scene in dataset.scenes}):
        scenes = [scene for scene in dataset.scenes if scene.split == split]
        infos = ((scene, parts_of_scene[scene.name]) for scene in scenes if scene.name in parts_of_scene)
        written.append(write_whole(root / "infos" / f"simbev_infos_{split}.json", _info_file(metadata(first), infos)))
    for scene in dataset.scenes:
        written += _write_config_and_log(dataset, scene, root)
    _sync(written)
    return left_out(first)


def write_whole(path: Path, pieces: Iterable[bytes]) -> Path:
    """Write a file, which gets its name only when it is complete.

    Returns:
        Path of the file.

    Raises:
        InputError: The file cannot be written.
    """
    unfinished = path.with_name(f".{path.name}.unfinished")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with unfinished.open("wb") as file:
            file.writelines(pieces)
        unfinished.rename(path)
    except OSError as error:
        unfinished.unlink(missing_ok=True)
        raise InputError(f"{path}: cannot be written: {error.strerror}") from None
    return path


def _sync(files: Sequence[Path]) -> None:
    """Force files and their names to the disk.

    Raises:
        InputError: A file cannot be written.
    """
    try:
        sync(*files)
        sync_names([*files, *(file.parent for file in files)])
    except OSError as error:
        raise InputError(f"{files[0].parent}: cannot be written: {error.strerror}") from None


def _info_file(head: Mapping[str, Any], scenes: Iterable[tuple[Scene, Sequence[Part]]]) -> Iterator[bytes]:
    """Content of the info file of one split, scene by scene, as it may be too large for the memory."""
    yield b'{"metadata": ' + _json(head) + b', "data": {'
    for index, (scene, parts) in enumerate(scenes):
        frames = [_with_file_paths(frame, part.root) for part in parts for frame in _frames_of(part)]
        info = _json({"scene_info": scene_info(scene), "scene_data": frames})
        yield b", " * (index > 0) + f'"scene_{scene.number:04d}": '.encode() + info
    yield b"}}"


def _frames_of(part: Part) -> list[dict[str, Any]]:
    """Entries of the frames of a finished part."""
    record = part.record()
    if record is None:
        raise InputError(f"{part.record_path}: frames from {part.first} of {part.scene} were changed meanwhile")
    frames: list[dict[str, Any]] = record["frames"]
    return frames


def _fingerprint(scene: Scene) -> str:
    """Fingerprint of a scene's bags, including additional ones."""
    bags = (scene.path, *scene.additional.values())
    return " ".join(f"{bytes_of(bag)} {locate_mcap(bag).stat().st_mtime_ns}" for bag in bags)


def _with_file_paths(frame: Mapping[str, Any], root: Path) -> dict[str, Any]:
    """The entry of a frame with the absolute paths of its files."""
    rest = {name: value for name, value in frame.items() if name != "files"}
    return {**rest, **{name: str(root.resolve() / file) for name, file in frame["files"].items()}}


def _write_config_and_log(dataset: Dataset, scene: Scene, root: Path) -> Iterator[Path]:
    """Write a scene's configuration and log, if they exist, and yield their paths."""
    name = f"SimBEV-scene-{scene.number:04d}"
    with SceneBag(scene.path) as bag:
        config = bag.attachments.get(CONFIG_ATTACHMENT)
    if config is not None:
        yield write_whole(root / "configs" / f"{name}.yaml", [config])
    log = dataset.path / "logs" / f"{scene.name}.log"
    if log.is_file():
        yield write_whole(root / "logs" / f"{name}.log", [log.read_bytes()])


@lru_cache(maxsize=1)
def _open_scene(dataset: Path, scene: str, _source: str) -> Scene:
    """Open a scene once for all its parts, and again only when its bags have changed."""
    return open_dataset(dataset, threads=1).scene(scene)


def _json(value: Any) -> bytes:
    return json.dumps(value).encode()
