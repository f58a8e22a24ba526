"""Datasets in SimBEV's own layout, for training code that was written for it.

Work is cut into parts of some frames of a scene, which can be done in any order and in many processes. A part is on
record when all its files are on the disk; an export that was stopped goes on with the parts that are not. Each file
gets its name when it is whole, and the info files come last.
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
    """Some frames of a scene.

    Attributes:
        dataset: Where it is read from.
        root: The layout's root.
        scene: Name of the scene.
        number: Its number.
        first: The first of the frames.
        count: How many frames there are.
        source: Tells the scene's bags from others that take their places.
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
        """Where it goes on record."""
        return self.root / _PARTS_FOLDER / f"scene_{self.number:04d}-{self.first:06d}.json"

    def record(self) -> dict[str, Any] | None:
        """What is on record of it; None: it is still to be made."""
        try:
            record: dict[str, Any] = json.loads(self.record_path.read_bytes())
        except (OSError, ValueError):
            return None
        return record if (record["source"], record["count"]) == (self.source, self.count) else None


def parts_of(dataset: Dataset, root: Path) -> list[Part]:
    """All parts of a dataset, made or not.

    Raises:
        InputError: There is nothing to export, or the sensors of scenes differ, which the layout cannot say.
        BagError: A bag cannot be read.
    """
    parts = []
    for scene in dataset.scenes:
        if metadata(scene) != metadata(dataset.scenes[0]):
            first = dataset.scenes[0].path
            raise InputError(f"{scene.path}: its sensors are not those of {first}, and the layout knows one rig")
        source = f"{scene.name} {scene.split} {_state(scene)}"
        for first_frame in range(0, len(scene), _FRAMES_PER_PART):
            count = min(_FRAMES_PER_PART, len(scene) - first_frame)
            parts.append(Part(dataset.path, root, scene.name, scene.number, first_frame, count, source))
    if not parts:
        raise InputError(f"{dataset.path}: it has no finished scene to export")
    return parts


def remove_replaced(parts: Iterable[Part]) -> None:
    """Remove what was made of bags that others have taken the place of, before parts are made."""
    sources = {part.number: (part.root, part.source) for part in parts}
    for number, (root, source) in sources.items():
        records = sorted((root / _PARTS_FOLDER).glob(f"scene_{number:04d}-*.json"))
        if any(json.loads(record.read_bytes())["source"] != source for record in records):
            for file in (*root.glob(f"*/*/SimBEV-scene-{number:04d}-frame-*"), *records):
                file.unlink()


def make_part(part: Part) -> int:
    """Write the files of a part, and put it on record.

    Returns:
        How many frames it has.

    Raises:
        InputError: A file cannot be written.
        BagError: The bag is damaged.
    """
    scene = _opened(part.dataset, part.scene, part.source)
    made = channels(scene)
    frames, written = [], []
    for frame in scene[part.first : part.first + part.count]:
        if "odom" not in frame:
            continue  # the end of a bag that was cut off
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
        What is not in the layout, a line each.

    Raises:
        InputError: A part is not on record, or a file cannot be written.
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
        written += _papers(dataset, scene, root)
    _sync(written)
    return left_out(first)


def write_whole(path: Path, pieces: Iterable[bytes]) -> Path:
    """Write a file, which has its name only when it is whole.

    Returns:
        Its path.

    Raises:
        InputError: It cannot be written.
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
    """Force files to the disk, with their names.

    Raises:
        InputError: One cannot be written.
    """
    try:
        sync(*files)
        sync_names([*files, *(file.parent for file in files)])
    except OSError as error:
        raise InputError(f"{files[0].parent}: cannot be written: {error.strerror}") from None


def _info_file(head: Mapping[str, Any], scenes: Iterable[tuple[Scene, Sequence[Part]]]) -> Iterator[bytes]:
    """The file of one split, scene by scene, as it may be larger than what fits in memory."""
    yield b'{"metadata": ' + _json(head) + b', "data": {'
    for index, (scene, parts) in enumerate(scenes):
        frames = [_placed(frame, part.root) for part in parts for frame in _recorded(part)]
        info = _json({"scene_info": scene_info(scene), "scene_data": frames})
        yield b", " * (index > 0) + f'"scene_{scene.number:04d}": '.encode() + info
    yield b"}}"


def _recorded(part: Part) -> list[dict[str, Any]]:
    """The frames of a part."""
    record = part.record()
    if record is None:
        raise InputError(f"{part.record_path}: frames from {part.first} of {part.scene} were changed meanwhile")
    frames: list[dict[str, Any]] = record["frames"]
    return frames


def _state(scene: Scene) -> str:
    """Tells a scene's bags, also additional ones, from others at the same places."""
    bags = (scene.path, *scene.additional.values())
    return " ".join(f"{bytes_of(bag)} {locate_mcap(bag).stat().st_mtime_ns}" for bag in bags)


def _placed(frame: Mapping[str, Any], root: Path) -> dict[str, Any]:
    """With the absolute paths of its files beside all else."""
    rest = {name: value for name, value in frame.items() if name != "files"}
    return {**rest, **{name: str(root.resolve() / file) for name, file in frame["files"].items()}}


def _papers(dataset: Dataset, scene: Scene, root: Path) -> Iterator[Path]:
    """Write a scene's configuration and log, as far as there are any."""
    name = f"SimBEV-scene-{scene.number:04d}"
    with SceneBag(scene.path) as bag:
        config = bag.attachments.get(CONFIG_ATTACHMENT)
    if config is not None:
        yield write_whole(root / "configs" / f"{name}.yaml", [config])
    log = dataset.path / "logs" / f"{scene.name}.log"
    if log.is_file():
        yield write_whole(root / "logs" / f"{name}.log", [log.read_bytes()])


@lru_cache(maxsize=1)
def _opened(dataset: Path, scene: str, _source: str) -> Scene:
    """A scene, opened once for all its parts; anew when its bag has changed."""
    return open_dataset(dataset, threads=1).scene(scene)


def _json(value: Any) -> bytes:
    return json.dumps(value).encode()
