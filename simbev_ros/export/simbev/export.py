"""Exports a dataset to the layout of SimBEV, for training code that was written for it.

A dataset enters; files of each frame, and info files about all of them, leave. The work is divided into parts of some
frames of a scene (``export.parts``), so that long scenes are spread over processes: ``parts_of`` lists them,
``make_part`` makes each one that has no record, and ``finish`` writes the info files.
"""

import json
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from simbev_ros.config.scenario import SPLITS
from simbev_ros.dataset import Dataset, Scene, open_dataset
from simbev_ros.export.parts import PARTS_FOLDER, Json, Part, fingerprint_of, remove_vanished
from simbev_ros.export.quaternions import continuous
from simbev_ros.export.simbev.channels import channels, left_out
from simbev_ros.export.simbev.infos import frame_info, metadata, scene_info
from simbev_ros.foundation.errors import InputError, foreign_content
from simbev_ros.foundation.files.confined_paths import path_inside
from simbev_ros.foundation.files.syncing import sync
from simbev_ros.foundation.files.whole_files import write_errors, write_whole
from simbev_ros.foundation.object_store.object_path import require_local
from simbev_ros.recording.layout import CONFIG_ATTACHMENT
from simbev_ros.recording.reader import SceneBag

ROOT = "simbev"
_FOLDERS = ("configs", "logs", "viz")
"""Folders that the layout has besides those of files of frames; SimBEV's viewer writes its pictures to ``viz``."""
_FRAMES_PER_PART = 20
"""Number of frames of a part, a multiple of 10, on which the patterns of a part's files depend."""

_PART_NAME = re.compile(r"scene_(?P<number>\d+)-(?P<first>\d+)")


@dataclass(frozen=True, slots=True, kw_only=True)
class FramesPart(Part):
    """Some consecutive frames of a scene as one part of the export.

    Attributes:
        dataset: Path of the dataset.
        scene: Name of the scene.
        agent: Name of the agent; None: the scene's first one.
        number: Number of the scene.
        first: Index of the first frame.
        count: Number of frames.
    """

    dataset: Path
    scene: str
    agent: str | None
    number: int
    first: int
    count: int


def parts_of(dataset: Dataset, root: Path) -> list[FramesPart]:
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
        bags = map(require_local, (scene.path, *scene.additional.values()))
        agent = [] if scene.chosen_agent is None else [scene.chosen_agent]
        source = " ".join([scene.name, scene.split, *map(fingerprint_of, bags), *agent])
        for first_frame in range(0, len(scene), _FRAMES_PER_PART):
            count = min(_FRAMES_PER_PART, len(scene) - first_frame)
            part = FramesPart(
                out=root,
                name=f"scene_{scene.number:04d}-{first_frame:06d}",
                identity={"source": source, "count": count},
                patterns=_patterns(scene.number, first_frame),
                dataset=require_local(dataset.path),
                scene=scene.name,
                agent=scene.chosen_agent,
                number=scene.number,
                first=first_frame,
                count=count,
            )
            parts.append(part)
    if not parts:
        raise InputError(f"{dataset.path}: it has no finished scene to export")
    return parts


def remove_ends(parts: Sequence[FramesPart]) -> None:
    """Remove earlier parts beyond the end of scenes that are now shorter, before parts are made.

    Raises:
        InputError: A file cannot be removed.
    """
    numbers = {part.number for part in parts}

    def patterns_of(name: str) -> tuple[str, ...] | None:
        match = _PART_NAME.fullmatch(name)
        return _patterns(*map(int, match.groups())) if match and int(match["number"]) in numbers else None

    remove_vanished(parts[0].out, [part.name for part in parts], patterns_of)


def make_part(part: FramesPart) -> int:
    """Make one part of the export, in any process.

    Returns:
        The number of its frames.

    Raises:
        InputError: A file cannot be written.
        BagError: The bag is damaged.
    """
    scene = _open_scene(part.dataset, part.scene, part.agent, part.identity["source"])
    made, labels = channels(scene), scene.view.label_period_ticks()
    frames = []
    part.begin()
    for tick in range(part.first, part.first + part.count):
        frame = scene[tick]  # one at a time: a frame keeps its images
        if tick % labels or "odom" not in frame:
            continue  # readers expect labels of each frame; or the end of a truncated bag
        files = {}
        for channel in made:
            if all(key in frame for key in channel.keys) and (content := channel.encode(frame)) is not None:
                files[channel.name] = channel.path(part.number, frame.tick)
                part.write(files[channel.name], content)
        frames.append({**frame_info(frame), "files": files})
    part.finish({"frames": frames})
    return part.count


def finish(dataset: Dataset, parts: Sequence[FramesPart], *, absolute_paths: bool = False) -> list[str]:
    """Write info files, configurations and logs, once all parts are finished.

    Args:
        dataset: The dataset.
        parts: All its parts.
        absolute_paths: Whether info files have absolute paths, which are wrong once the export is moved, instead of
            paths relative to the layout's root.

    Returns:
        Lines of text that name what is missing in the layout.

    Raises:
        InputError: A part has no record, or a file cannot be written.
    """
    root, first = parts[0].out, dataset.scenes[0]
    parts_of_scene: dict[str, list[FramesPart]] = {}
    for part in parts:
        parts_of_scene.setdefault(part.scene, []).append(part)
        part.tidy_up()
    with foreign_content(root / PARTS_FOLDER), write_errors(root):
        for folder in _FOLDERS:
            (root / folder).mkdir(parents=True, exist_ok=True)
            sync(root / folder)
        for split in SPLITS:
            scenes = [scene for scene in dataset.scenes if scene.split == split]
            infos = ((scene, parts_of_scene[scene.name]) for scene in scenes if scene.name in parts_of_scene)
            content = _info_file(metadata(first), infos, root.resolve() if absolute_paths else Path())
            write_whole(root / "infos" / f"simbev_infos_{split}.json", content)
        for scene in dataset.scenes:
            _write_config_and_log(dataset, scene, root)
        return [*left_out(first), *_incomplete(parts)]


def _incomplete(parts: Sequence[FramesPart]) -> list[str]:
    """Lines of text that name the sensors and labels that are missing in some frames."""
    frames = [frame["files"] for part in parts for frame in part.finished_record()["frames"]]
    counts = Counter(name for files in frames for name in files)
    found = [f"{name} in {count} of {len(frames)}" for name, count in counts.items() if count < len(frames)]
    return [f"not in every frame: {', '.join(found)}"] if found else []


def _info_file(head: Json, scenes: Iterable[tuple[Scene, Sequence[FramesPart]]], prefix: Path) -> Iterator[bytes]:
    """Content of the info file of one split, scene by scene, as it may be too large for the memory."""
    yield b'{"metadata": ' + _json(head) + b', "data": {'
    for index, (scene, parts) in enumerate(scenes):
        frames = [_with_file_paths(frame, prefix) for part in parts for frame in part.finished_record()["frames"]]
        rotations = continuous([frame["ego2global_rotation"] for frame in frames])
        for frame, rotation in zip(frames, rotations.tolist(), strict=True):
            frame["ego2global_rotation"] = rotation
        info = _json({"scene_info": scene_info(scene), "scene_data": frames})
        yield b", " * (index > 0) + f'"scene_{scene.number:04d}": '.encode() + info
    yield b"}}"


def _patterns(number: int, first: int) -> tuple[str, ...]:
    """Glob patterns of all files that a part of a scene can have, in tens of frames."""
    tens = range(first // 10, (first + _FRAMES_PER_PART) // 10)
    return tuple(f"*/*/SimBEV-scene-{number:04d}-frame-{ten:03d}[0-9]-*" for ten in tens)


def _with_file_paths(frame: Mapping[str, Any], prefix: Path) -> dict[str, Any]:
    """The entry of a frame with the paths of its files behind a prefix."""
    rest = {name: value for name, value in frame.items() if name != "files"}
    return {**rest, **{name: str(prefix / file) for name, file in frame["files"].items()}}


def _write_config_and_log(dataset: Dataset, scene: Scene, root: Path) -> None:
    """Write a scene's configuration, if there is one, and its log: the dataset's, or else what the bag says."""
    name = f"SimBEV-scene-{scene.number:04d}"
    with SceneBag(scene.path) as bag:
        config, ended = bag.attachments.get(CONFIG_ATTACHMENT), bag.custom_data.get("ended", "not finished")
    if config is not None:
        write_whole(root / "configs" / f"{name}.yaml", config)
    log = path_inside(require_local(dataset.path), Path("logs", f"{scene.name}.log"))
    known = f"{scene.name}: {len(scene)} frames, seed {scene.spec.seed}, ended: {ended}\n"
    write_whole(root / "logs" / f"{name}.log", log.read_bytes() if log.is_file() else known.encode())


@lru_cache(maxsize=1)
def _open_scene(dataset: Path, name: str, agent: str | None, _source: str) -> Scene:
    """Open an agent's scene once for all its parts, and again only when its bags have changed."""
    scene = open_dataset(dataset, threads=1).scene(name)
    return scene if agent is None else scene.of_agent(agent)


def _json(value: Any) -> bytes:
    return json.dumps(value).encode()
