"""Exports a dataset to nuScenes' layout: scenes in parallel processes, then masks of maps and the tables.

The entry point of ``simbev export nuscenes``: an opened dataset enters; a folder that the devkit can open leaves.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import repeat
from pathlib import Path

from simbev_ros.dataset import Dataset, Scene
from simbev_ros.dataset.lock import DatasetLock
from simbev_ros.dataset.parallel import in_processes
from simbev_ros.errors import BagError, InputError
from simbev_ros.export.nuscenes.map_masks import sites_of, write_mask
from simbev_ros.export.nuscenes.parts import Parts
from simbev_ros.export.nuscenes.scene_part import make_part
from simbev_ros.export.nuscenes.tables import write_tables

VERSION = "v1.0-trainval"


@dataclass(frozen=True, slots=True)
class Exported:
    """Result of an export.

    Attributes:
        scenes: Number of scenes in the export.
        made: Number of scenes that this run has exported; the others were already there.
        samples: Number of keyframes of all scenes.
        files: Number of sensor files of all scenes.
        failures: Reasons why scenes could not be exported, by name of the scene.
    """

    scenes: int
    made: int
    samples: int
    files: int
    failures: dict[str, str]


def export_nuscenes(
    dataset: Dataset,
    out: Path,
    *,
    keyframe_hz: float | None = 2.0,
    sweeps: bool = True,
    version: str = VERSION,
    jobs: int = 1,
    report: Callable[[int, int], None] = lambda done, total: None,
) -> Exported:
    """Export the finished scenes of a dataset; scenes that are already in the folder and have not changed are kept.

    Args:
        dataset: The dataset.
        out: Folder of the export, nuScenes' ``dataroot``.
        keyframe_hz: Number of keyframes, which have annotations, per second; None: every frame is one.
        sweeps: Whether to write sensor data between keyframes.
        version: Name of the tables' folder.
        jobs: Number of scenes that are exported in parallel.
        report: Called from time to time with the number of finished frames and the number of all frames to export.

    Raises:
        InputError: There is nothing to export, the folder cannot be written to or contains other data, another process
            writes into it, or a map's roads cannot be built.
        SimbevError: A process was killed.
    """
    if not dataset.scenes:
        raise InputError(f"{dataset.path}: it has no finished scene to export")
    parts = Parts(out, {"keyframe_hz": keyframe_hz, "sweeps": sweeps})
    if not parts.is_begun and any((out / name).exists() for name in (version, "samples", "maps")):
        raise InputError(f"{out}: it holds data of nuScenes' layout that simbev has not written; take another folder")
    with DatasetLock(out), _reported_write_errors(out):
        missing = [scene for scene in dataset.scenes if not parts.is_done(scene)]
        failures = _make(parts, missing, jobs, report)
        scenes = [scene for scene in dataset.scenes if scene.name not in failures]
        summaries = [{**parts.summary(scene), "bag": str(scene.path)} for scene in scenes]
        if scenes:
            sites = sites_of(summaries)
            for site in sites:
                write_mask(site, out)
            write_tables(parts, scenes, sites, version)
        parts.tidy()
    samples, files = (sum(each[name] for each in summaries) for name in ("samples", "files"))
    return Exported(len(scenes), len(missing) - len(failures), samples, files, failures)


@contextmanager
def _reported_write_errors(out: Path) -> Iterator[None]:
    """Turn errors of the file system into errors for the user."""
    try:
        yield
    except OSError as error:
        raise InputError(f"{error.filename or out}: cannot be written: {error.strerror}") from None


def _make(parts: Parts, scenes: list[Scene], jobs: int, report: Callable[[int, int], None]) -> dict[str, str]:
    """Make the parts of scenes in parallel; return why scenes could not be exported, by name of the scene."""
    frames = sum(map(_frame_count, scenes))
    work, jobs = zip(repeat(parts), scenes, strict=False), min(jobs, max(len(scenes), 1))
    report(0, frames)
    problems = list(in_processes(_make_part, work, jobs, lambda done: report(done, frames)))
    report(frames, frames)
    return {scene.name: problem for scene, problem in zip(scenes, problems, strict=True) if problem is not None}


def _make_part(work: tuple[Parts, Scene]) -> str | None:
    """Make the part of one scene; return what is wrong with the scene, or None."""
    parts, scene = work
    try:
        make_part(scene, parts)
    except BagError as error:
        return str(error)
    return None


def _frame_count(scene: Scene) -> int:
    """Number of frames of a scene; 0 for a damaged one, which is reported when it is exported."""
    try:
        return len(scene)
    except BagError:
        return 0
