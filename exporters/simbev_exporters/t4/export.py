"""Exports a dataset to T4, TIER IV's format: one dataset in a folder of its own for each scene, in parallel.

The entry point of ``simbev export t4``: an opened dataset enters; folders that t4-devkit can open leave.
"""

import json
import shutil
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from glob import escape
from pathlib import Path

import numpy as np
import yaml

from simbev_exporters.nuscenes.taxonomy import Record
from simbev_exporters.scene_parts import (
    Failures,
    PartOfScene,
    Report,
    ignore_progress,
    make_missing,
    source_of,
    without,
)
from simbev_exporters.t4.scene_tables import T4Tables
from simbev_ros import __version__
from simbev_ros.config.scenario import SPLITS
from simbev_ros.dataset import Dataset, Scene
from simbev_ros.dataset.nuscenes.channels import ChannelNames, require_named_sensors
from simbev_ros.dataset.nuscenes.keyframes import swept_ticks
from simbev_ros.dataset.parallel import OWN_PROCESS, Pool, report_step
from simbev_ros.export.parts import PARTS_FOLDER, hold_export, is_begun
from simbev_ros.foundation.errors import BagError, InputError, foreign_content
from simbev_ros.foundation.files.whole_files import write_whole
from simbev_ros.foundation.installation.extras import load_extras
from simbev_ros.foundation.object_store.object_path import require_local
from simbev_ros.recording.layout import METADATA_FILE, mcap_files

SPLITS_FILE = "splits.yaml"
"""File that lists the datasets of each split."""

_FOLDERS = ("annotation", "data/*", "input_bag", "lidarseg/annotation", "map", "")


@dataclass(frozen=True, slots=True)
class T4Settings:
    """Options of an export.

    Attributes:
        keyframe_hz: Number of samples, which have annotations, per second; None: every frame is one.
        keep_unhit: Whether boxes without lidar and radar points are annotated.
        lidarseg: Whether to write the categories of lidar points, for scenes with semantic clouds of all lidars.
        input_bag: Whether to copy the scene's bag.
        channels: Channels of cameras and radars that are not to have the names of ``channels_of``.
    """

    keyframe_hz: float | None = 10.0
    keep_unhit: bool = False
    lidarseg: bool = False
    input_bag: bool = False
    channels: ChannelNames = field(default_factory=dict)


_DEFAULTS = T4Settings()


@dataclass(frozen=True, slots=True, kw_only=True)
class T4Part(PartOfScene):
    """The dataset of a scene as one part of the export. Its record has the numbers of ``samples`` and ``files``.

    Attributes:
        settings: Settings of the export.
        has_map: Whether the map is written, which needs the simulator.
    """

    settings: T4Settings
    has_map: bool


@dataclass(frozen=True, slots=True)
class Exported:
    """Result of an export.

    Attributes:
        scenes: Number of scenes in the export.
        made: Number of scenes that this run has exported; the others were already there.
        samples: Number of samples of all scenes.
        files: Number of sensor files of all scenes.
        failures: Reasons why scenes could not be exported, by name of the scene.
        has_maps: Whether maps were written.
    """

    scenes: int
    made: int
    samples: int
    files: int
    failures: Failures
    has_maps: bool


def export_t4(
    dataset: Dataset,
    out: Path,
    settings: T4Settings = _DEFAULTS,
    *,
    pool: Pool = OWN_PROCESS,
    report: Report = ignore_progress,
) -> Exported:
    """Export the finished scenes of a dataset; scenes that are already in the folder and have not changed are kept.

    Args:
        dataset: The dataset.
        out: Folder of the export, with a folder for each scene.
        settings: What is written.
        pool: Workers that export scenes.
        report: Receives the progress.

    Raises:
        InputError: There is nothing to export, the folder cannot be written to or contains other data, another process
            writes into it, a map's roads cannot be built, or names of channels are wrong.
        SimbevError: A process was killed.
    """
    if not dataset.scenes:
        raise InputError(f"{dataset.path}: it has no finished scene to export")
    if settings.channels:
        require_named_sensors(dataset.scenes[0], settings.channels)
    if not is_begun(out) and any((out / scene.name).exists() for scene in dataset.scenes):
        raise InputError(f"{out}: it holds folders of the scenes that simbev has not written; take another folder")
    has_maps = not load_extras()["sim"].missing
    parts = [_part(scene, out, settings, has_map=has_maps) for scene in dataset.scenes]
    with hold_export(out):
        missing, failures = make_missing(make_part, parts, pool, report, _frame_count)
        for name in failures:
            shutil.rmtree(out / name, ignore_errors=True)
        finished = without(parts, failures)
        write_whole(out / SPLITS_FILE, _splits(finished))
        with foreign_content(out / PARTS_FOLDER):
            records = [part.finished_record() for part in finished]
            return Exported(
                scenes=len(finished),
                made=len(missing) - len(failures),
                samples=sum(record["samples"] for record in records),
                files=sum(record["files"] for record in records),
                failures=failures,
                has_maps=has_maps,
            )


def make_part(part: T4Part) -> None:
    """Make the dataset of one scene, in any process; each frame is a step of parallel work.

    Raises:
        InputError: The scene cannot have samples at that rate, its roads cannot be built, or a file cannot be written.
        BagError: The bag is damaged or lacks data that the tables need.
    """
    scene, settings = part.scene, part.settings

    def write(path: str, content: bytes) -> None:
        part.write(f"{scene.name}/{path}", content)

    wanted = {"keep_unhit": settings.keep_unhit, "lidarseg": settings.lidarseg}
    job = T4Tables(scene, settings.keyframe_hz, settings.channels, write, **wanted)
    part.begin()
    for tick in swept_ticks(scene).tolist():
        job.add(scene[tick])
        report_step()
    tables, bag = job.tables(), require_local(scene.path)
    for name, rows in tables.items():
        write(f"annotation/{name}.json", _table(rows))
    if part.has_map:
        from simbev_exporters.t4.map_files import map_files

        path_m = np.array([row["translation"] for row in tables["ego_pose"]])
        for name, content in map_files(bag, path_m).items():
            write(f"map/{name}", content)
    for file in (*mcap_files(bag), bag / METADATA_FILE) if settings.input_bag else ():
        if file.is_file():
            with part.open(f"{scene.name}/input_bag/{file.name}") as copy, file.open("rb") as source:
                shutil.copyfileobj(source, copy)
    write("status.json", _status(scene))
    summary = job.summary()
    part.finish({"samples": summary["samples"], "files": summary["files"]})


def _part(scene: Scene, out: Path, settings: T4Settings, *, has_map: bool) -> T4Part:
    channels = {sensor: list(names) for sensor, names in sorted(settings.channels.items())}
    chosen = {**asdict(settings), "channels": channels}
    return T4Part(
        out=out,
        name=f"{scene.name}.t4",
        identity={"made_from": {**source_of(scene), **chosen, "map": has_map}},
        patterns=tuple(f"{escape(scene.name)}/{folder}/*.*".replace("//", "/") for folder in _FOLDERS),
        scene=scene,
        settings=settings,
        has_map=has_map,
    )


def _table(rows: Sequence[Record]) -> bytes:
    """A JSON list with a row on each line."""
    return ("[" + ",\n".join(map(json.dumps, rows)) + "]\n").encode()


def _status(scene: Scene) -> bytes:
    """What the scene was made of; the format does not say what the file has."""
    spec = scene.spec
    facts = {
        "generator": f"simbev_ros {__version__}",
        "scene": {"name": scene.name, "split": scene.split, "seed": spec.seed, "map": spec.map.name},
        "weather": spec.weather.model_dump(mode="json"),
    }
    return (json.dumps(facts, indent=1) + "\n").encode()


def _splits(parts: Sequence[T4Part]) -> bytes:
    names = {split: [part.scene.name for part in parts if part.scene.split == split] for split in SPLITS}
    return yaml.safe_dump(names, sort_keys=False).encode()


def _frame_count(part: T4Part) -> int:
    """Number of frames with sensor data; 0 for a damaged scene, which is reported when it is exported."""
    try:
        return int(np.size(swept_ticks(part.scene)))
    except BagError:
        return 0
