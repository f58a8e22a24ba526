"""A whole dataset in nuScenes' layout: scenes side by side, each in a process, then masks of maps and tables."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import repeat
from pathlib import Path

from simbev_ros.dataset import Dataset, Scene
from simbev_ros.dataset.lock import DatasetLock
from simbev_ros.dataset.parallel import map_in_processes
from simbev_ros.errors import BagError, InputError
from simbev_ros.export.nuscenes.map_masks import sites_of, write_mask
from simbev_ros.export.nuscenes.parts import Parts
from simbev_ros.export.nuscenes.scene_part import make_part
from simbev_ros.export.nuscenes.tables import write_tables

VERSION = "v1.0-trainval"


@dataclass(frozen=True, slots=True)
class Exported:
    """What came of it.

    Attributes:
        scenes: How many scenes are in the export.
        made: How many of them this run has made.
        samples: How many keyframes they have.
        files: How many files of sensors.
        failures: By name of scene why it could not be exported.
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
    """Export scenes; those that are in the folder as they are now are left as they are.

    Args:
        dataset: The scenes.
        out: The folder, nuScenes' ``dataroot``.
        keyframe_hz: How often there is a keyframe, which has annotations; None: every frame is one.
        sweeps: Whether to have what sensors saw between keyframes.
        version: Name of the tables' folder.
        jobs: How many scenes at once.
        report: Told now and then how many frames are done, and how many there are to do.

    Raises:
        InputError: There is nothing to export, the folder cannot be written to or holds other data, another process
            writes into it, or a map's roads cannot be built.
        SimbevError: A process was killed.
    """
    if not dataset.scenes:
        raise InputError(f"{dataset.path}: it has no finished scene to export")
    parts = Parts(out, {"keyframe_hz": keyframe_hz, "sweeps": sweeps})
    if not parts.are_begun and any((out / name).exists() for name in (version, "samples", "maps")):
        raise InputError(f"{out}: it holds data of nuScenes' layout that simbev has not written; take another folder")
    with DatasetLock(out), _writing(out):
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
def _writing(out: Path) -> Iterator[None]:
    """What cannot be written is said to the user."""
    try:
        yield
    except OSError as error:
        raise InputError(f"{error.filename or out}: cannot be written: {error.strerror}") from None


def _make(parts: Parts, scenes: list[Scene], jobs: int, report: Callable[[int, int], None]) -> dict[str, str]:
    """Make the parts of scenes; give of those that could not be made why."""
    frames = sum(map(_frames_of, scenes))
    work, jobs = zip(repeat(parts), scenes, strict=False), min(jobs, max(len(scenes), 1))
    report(0, frames)
    problems = list(map_in_processes(_make_part, work, jobs, lambda done: report(done, frames)))
    report(frames, frames)
    return {scene.name: problem for scene, problem in zip(scenes, problems, strict=True) if problem is not None}


def _make_part(work: tuple[Parts, Scene]) -> str | None:
    """Make one; give what is wrong with the scene, if anything is."""
    parts, scene = work
    try:
        make_part(scene, parts)
    except BagError as error:
        return str(error)
    return None


def _frames_of(scene: Scene) -> int:
    """How many there are; of a damaged scene none, which is said when its turn comes."""
    try:
        return len(scene)
    except BagError:
        return 0
