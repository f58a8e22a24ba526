"""Times the driver of datasets with many scenes, and measures its memory; each number of scenes in a process."""

import multiprocessing
import re
import shutil
import tempfile
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack, closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

from simbev_ros.config.load import load_scenario
from simbev_ros.dataset.growing_index import GrowingIndex
from simbev_ros.dataset.index import index_table
from simbev_ros.dataset.lock import DatasetLock
from simbev_ros.dataset.plan import Plan, PlannedEntry
from simbev_ros.foundation.errors import DiskError, SimbevError
from simbev_ros.foundation.files.whole_files import write_errors
from simbev_ros.production.cluster.node_check import check_nodes
from simbev_ros.production.cluster.ray_cluster import RayCluster
from simbev_ros.production.dataset_maker import DatasetMaker
from simbev_ros.production.events import ProductionEvent, SceneMade
from simbev_ros.production.folder_storage import FolderStorage
from simbev_ros.production.observer import ProductionObserver, SeveralObservers
from simbev_ros.production.workers.ray_metrics import RayMetrics
from simbev_ros.production.workers.ray_worker_pool import RayWorkerPool
from simbev_ros.production.workers.worker_pool import WorkerPool
from simbev_ros.recording.layout import scenes_folder
from tools.bench.production.copying_workers import CopyingPool, RecordedScene, copying_actor

R = TypeVar("R")

_KIB_PER_MIB, _BLOCK_BYTES = 1024.0, 4096


@dataclass(frozen=True, slots=True)
class DriverRun:
    """Time and memory that the driver took for a dataset.

    Attributes:
        scenes: Number of scenes.
        making_s: Time to make them all, including the start of workers.
        late_ms_per_scene: Time per scene in the second half of the scenes, without copying in the driver's process.
        copying_s: Part of it in which a worker copied in the driver's process; 0 with Ray.
        index_s: Part of it in which the index was written.
        index_writes: Number of times that the index was written.
        reopening_s: Time to read the finished dataset, as every further run does before it makes scenes.
        peak_mib: Peak resident memory of the driver, in this run or the further one.
    """

    scenes: int
    making_s: float
    late_ms_per_scene: float
    copying_s: float
    index_s: float
    index_writes: int
    reopening_s: float
    peak_mib: float


@dataclass(frozen=True, slots=True)
class ProductionTiming:
    """The driver's time and memory at several numbers of scenes.

    Attributes:
        pool: What copied the scenes.
        scene_bytes: Size of each scene.
        runs: The measurements.
    """

    pool: str
    scene_bytes: int
    runs: list[DriverRun]

    def title(self) -> str:
        """Title of the table."""
        return f"the driver of a production with scenes of {self.scene_bytes:,} bytes, which are copied by {self.pool}"

    def rows(self) -> list[tuple[str, ...]]:
        """Rows of a table, one for each number of scenes."""
        return [
            (
                f"{run.scenes:,}",
                f"{run.making_s:.1f}",
                f"{run.late_ms_per_scene:.2f}",
                f"{run.copying_s:.1f}",
                f"{run.index_s:.1f}",
                f"{run.index_writes}",
                f"{run.reopening_s:.1f}",
                f"{run.peak_mib:.0f}",
            )
            for run in self.runs
        ]


def require_space(folder: Path, recorded: RecordedScene, count: int) -> None:
    """Refuse to fill a disk with copies of a scene.

    Raises:
        DiskError: They do not fit.
    """
    wanted_bytes, free_bytes = count * _bytes_on_disk(recorded), shutil.disk_usage(folder).free
    if wanted_bytes > free_bytes:
        raise DiskError(
            f"{folder}: the copies take {wanted_bytes / 1e9:.1f} GB, and {free_bytes / 1e9:.1f} GB are free"
        )


def timed_production(
    recorded: RecordedScene,
    counts: Sequence[int],
    *,
    folder: Path,
    workers: int,
    ray: str | None,
    advance: Callable[[], None] = lambda: None,
) -> ProductionTiming:
    """Make datasets of copies of a scene.

    Args:
        recorded: The scene.
        counts: Numbers of scenes.
        folder: Folder in which datasets are made, and removed again; the nodes of a cluster see it.
        workers: Number of workers without Ray.
        ray: Address of a Ray cluster with nodes that copy; None: the driver's process copies.
        advance: Called after each dataset.

    Raises:
        InputError: The cluster cannot be used, or the folder cannot be written to.
        DiskError: The disk is full.
        SimbevError: A process was killed.
    """
    runs = []
    with write_errors(folder), tempfile.TemporaryDirectory(prefix="simbev_ros-bench-", dir=folder) as place:
        own = replace(recorded, bag=Path(place).absolute() / recorded.bag.name)
        shutil.copytree(recorded.bag, own.bag)
        for count in counts:
            out = Path(place).absolute() / "dataset"
            runs.append(_measure(own, count, out, workers, ray))
            shutil.rmtree(out)
            advance()
    pool = f"{workers} workers in its process" if ray is None else "actors on a Ray cluster"
    return ProductionTiming(pool, recorded.row["bytes"], runs)


def _bytes_on_disk(recorded: RecordedScene) -> int:
    """Space that a copy takes: its files, its folder and its log, in whole blocks."""
    sizes = [file.stat().st_size for file in recorded.bag.iterdir() if file.is_file()]
    return sum(-(-size // _BLOCK_BYTES) for size in (*sizes, 1, 1)) * _BLOCK_BYTES


class _TimedIndex(GrowingIndex):
    """Counts how often it is written, and how long that takes."""

    def __init__(self, dataset: Path) -> None:
        super().__init__(dataset, index_table([]))
        self.writes, self.writing_s = 0, 0.0

    def write(self) -> None:
        """Write it, if there are new rows."""
        is_new, began_s = bool(self._new), time.perf_counter()
        super().write()
        self.writes += is_new
        self.writing_s += time.perf_counter() - began_s


class _SecondHalf(ProductionObserver):
    """Times the second half of the scenes.

    Args:
        scenes: Number of scenes, at least 2.
        pool: The workers; their copies in this process do not count.
    """

    def __init__(self, scenes: int, pool: WorkerPool) -> None:
        self._scenes, self._pool, self._made = scenes, pool, 0
        self._times_s: list[float] = []

    def notify(self, event: ProductionEvent) -> None:
        """Note the time at the middle and at the end."""
        self._made += isinstance(event, SceneMade)
        if isinstance(event, SceneMade) and self._made in (self._scenes // 2, self._scenes):
            self._times_s.append(time.perf_counter() - _copying_s(self._pool))

    @property
    def ms_per_scene(self) -> float:
        """Time per scene, without copies."""
        middle_s, end_s = self._times_s
        return (end_s - middle_s) / (self._scenes - self._scenes // 2) * 1e3


def _measure(recorded: RecordedScene, count: int, out: Path, workers: int, ray: str | None) -> DriverRun:
    """Make a dataset in one process, and read it again in another one, as a further run does."""
    run = _in_new_process(count, _make, recorded, count, out, workers, ray)
    reopening_s, peak_mib = _in_new_process(count, _reopen, out)
    return replace(run, reopening_s=reopening_s, peak_mib=max(run.peak_mib, peak_mib))


def _in_new_process(count: int, work: Callable[..., R], *arguments: object) -> R:
    """Do a part of the work in a new process, with memory of its own."""
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as process:
        try:
            return process.submit(work, *arguments).result()
        except BrokenProcessPool:
            raise SimbevError(f"the driver of {count:,} scenes was killed; is there memory enough?") from None


def _peak_mib() -> float:
    """Peak resident memory of this program; ``getrusage`` counts the process that it was started by as well."""
    status = Path("/proc/self/status").read_text()
    return int(re.findall(r"^VmHWM:\s*(\d+) kB$", status, re.MULTILINE)[0]) / _KIB_PER_MIB


def _make(recorded: RecordedScene, count: int, out: Path, workers: int, ray: str | None) -> DriverRun:
    """Make a dataset as ``make_dataset`` does, with workers that copy; reading it again is not measured yet."""
    map_name, split = recorded.row["map"], recorded.row["split"]
    with ExitStack() as held:
        cluster = None if ray is None else held.enter_context(RayCluster(ray))
        held.enter_context(DatasetLock(out))
        if cluster is not None:
            check_nodes(cluster, out)
        plan = Plan().with_entries(PlannedEntry(number=k, map=map_name, split=split) for k in range(count))
        plan.save(out)
        scenes_folder(out).mkdir()
        folder = held.enter_context(closing(FolderStorage(out, [], 0)))
        folder.index = index = _TimedIndex(out)
        pool = held.enter_context(_open_pool(recorded, folder.staging, workers, cluster, count))
        late = _SecondHalf(count, pool)
        observer = late if cluster is None else SeveralObservers(late, RayMetrics(out.name))
        began_s = time.perf_counter()
        outcome = DatasetMaker(folder, pool, retries=0, observer=observer).make(plan.scenes)
        making_s = time.perf_counter() - began_s
    if outcome.failed:
        name, reason = next(iter(outcome.failed.items()))
        raise SimbevError(f"{len(outcome.failed):,} of {count:,} scenes could not be copied; {name}: {reason}")
    times = making_s, late.ms_per_scene, _copying_s(pool), index.writing_s
    return DriverRun(count, *times, index.writes, reopening_s=0.0, peak_mib=_peak_mib())


def _open_pool(
    recorded: RecordedScene, staging: Path, workers: int, cluster: RayCluster | None, count: int
) -> WorkerPool:
    """Workers that copy, in this process or on a cluster."""
    if cluster is None:
        return CopyingPool(recorded, staging, workers)
    return RayWorkerPool(cluster, load_scenario("demo"), staging, count, actor_class=copying_actor(recorded))


def _copying_s(pool: WorkerPool) -> float:
    """Time that this process has spent on copies."""
    return pool.copying_s if isinstance(pool, CopyingPool) else 0.0


def _reopen(out: Path) -> tuple[float, float]:
    """Read a finished dataset, as before scenes are made; return the time, and the peak memory in MiB."""
    began_s = time.perf_counter()
    plan = Plan.load(out)
    plan.save(out)
    FolderStorage(out, plan.finished_entries(out), 0).close()
    return time.perf_counter() - began_s, _peak_mib()
