"""Estimating the time and disk space that a dataset would take, from a short measured sample of its first scene."""

import shutil
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from simbev_ros.config.scenario import Scenario, Split
from simbev_ros.dataset.plan import Plan, PlannedEntry
from simbev_ros.foundation.object_store.object_path import AnyPath, ObjectPath
from simbev_ros.production.dataset import without_stack
from simbev_ros.production.drawing import PlannedSceneDrawer
from simbev_ros.production.events import SceneEnded, SceneProgressed, SceneStarted
from simbev_ros.production.free_stations import require_free_stations
from simbev_ros.production.observer import SILENT, ProductionObserver
from simbev_ros.production.scene_cost import CostMeter, SceneCost
from simbev_ros.production.surroundings import build_surroundings
from simbev_ros.recording.layout import bytes_of, scene_folder
from simbev_ros.recording.reader import SceneBag
from simbev_ros.ros.graph.session import GraphSession
from simbev_ros.scene.drawing.draw_scene import duration_ticks
from simbev_ros.scene.ending import SceneEnd
from simbev_ros.schema.scene.spec import SceneSpec

SAMPLE_TICKS = 10
"""Maximum length of the sample scene."""

SceneCounts = Counter[tuple[str, Split]]
"""Number of scenes by map and split."""


@dataclass(frozen=True, slots=True)
class Sample:
    """Measurements of a short scene.

    Attributes:
        start_s: Time until its first tick was finished, on a graph that runs already.
        tick_s: Time per tick after that.
        tick_bytes: Size in the bag, per tick.
        scene_bytes: Size in the bag that does not depend on the scene's length.
        cost: What it took in all.
    """

    start_s: float
    tick_s: float
    tick_bytes: float
    scene_bytes: float
    cost: SceneCost


@dataclass(frozen=True, slots=True)
class Estimate:
    """Estimated cost of the scenes that a dataset still lacks.

    Attributes:
        scenes: Number of scenes to make.
        frames: Number of their frames.
        duration_s: Time to make them.
        speedup: Factor by which graphs side by side make that shorter than one graph would.
        size_bytes: Disk space for them.
        free_bytes: Space that is free on the dataset's disk; None: it is in an object store.
        sample: The measurements that the estimate is based on.
    """

    scenes: int
    frames: int
    duration_s: float
    speedup: float
    size_bytes: float
    free_bytes: int | None
    sample: Sample


def count_scenes(dataset: AnyPath, entries: Sequence[PlannedEntry]) -> tuple[SceneCounts, SceneCounts]:
    """Count the finished scenes of a dataset, and the scenes to make, by map and split."""
    existing = Plan.load(dataset).finished_entries(dataset)
    return Counter((entry.map, entry.split) for entry in existing), Counter(
        (entry.map, entry.split) for entry in entries
    )


def estimate_dataset(
    scenario: Scenario,
    dataset: AnyPath,
    entries: Sequence[PlannedEntry],
    observer: ProductionObserver = SILENT,
    speedup: Callable[[SceneCost], float] = lambda cost: 1.0,
) -> Estimate:
    """Estimate the cost of making scenes; nothing is written into the dataset.

    Args:
        scenario: The configuration.
        dataset: The dataset, which need not exist.
        entries: The scenes to make, at least one; the first one is sampled.
        observer: Receives the progress of the sample.
        speedup: Factor by which the scenes are made faster than by one graph on this machine, by the sample's cost.

    Raises:
        InputError: The sample cannot be drawn or played with this configuration.
        GraphError: A node died or fell silent.
    """
    sample = _measure_sample(without_stack(scenario), entries[0], observer)
    ticks = sum(duration_ticks(scenario.time, scenario.seed + entry.number) for entry in entries)
    factor = max(min(speedup(sample.cost), len(entries)), 1.0)
    return Estimate(
        scenes=len(entries),
        frames=ticks,
        duration_s=(len(entries) * sample.start_s + ticks * sample.tick_s) / factor,
        speedup=factor,
        size_bytes=len(entries) * sample.scene_bytes + ticks * sample.tick_bytes,
        free_bytes=None if isinstance(dataset, ObjectPath) else shutil.disk_usage(_nearest_existing(dataset)).free,
        sample=sample,
    )


def _measure_sample(scenario: Scenario, entry: PlannedEntry, observer: ProductionObserver) -> Sample:
    """Record the beginning of a scene into a temporary dataset."""
    spec = PlannedSceneDrawer(scenario, observer).draw(entry)
    spec = spec.model_copy(update={"ticks": min(SAMPLE_TICKS, spec.ticks)})
    build_surroundings([spec], observer)
    require_free_stations(scenario, [spec])
    with tempfile.TemporaryDirectory(prefix="simbev_ros-sample-") as folder:
        finished_s, cost = _time_ticks(scenario, spec, Path(folder), observer)
        bag_path = scene_folder(Path(folder), spec.split, spec.name)
        size = bytes_of(bag_path)
        with SceneBag(bag_path) as bag:
            fixed = min(sum(len(data) for data in bag.attachments.values()), size)
    ticks = len(finished_s)
    tick_s = (finished_s[-1] - finished_s[0]) / max(ticks - 1, 1)
    return Sample(finished_s[0], tick_s, (size - fixed) / ticks, fixed, cost)


def _time_ticks(
    scenario: Scenario, spec: SceneSpec, folder: Path, observer: ProductionObserver
) -> tuple[list[float], SceneCost]:
    """Play a scene on a graph that runs already; return for each tick the time from the start to its end, s."""
    finished_s: list[float] = []
    end: SceneEnd | None = None
    with GraphSession(scenario, dataset=folder) as session:
        observer.notify(SceneStarted(spec))
        try:
            first = spec.model_copy(update={"ticks": 1, "number": spec.number + 1})
            session.play(first, lambda _: None)  # the start of processes is paid once for all scenes
            began_s, meter = time.monotonic(), CostMeter(session.pids().values())

            def progress(tick: int | None) -> None:
                observer.notify(SceneProgressed(spec.name, tick))
                meter.look(session.pids().values())
                while tick is not None and len(finished_s) <= tick:
                    finished_s.append(time.monotonic() - began_s)

            end = session.play(spec, progress)
            cost = meter.cost(session.pids().values(), len(finished_s))
        finally:
            observer.notify(SceneEnded(spec.name, end))
    return finished_s, cost


def _nearest_existing(path: Path) -> Path:
    """The folder itself, or its nearest ancestor that exists."""
    return next(folder for folder in (path.resolve(), *path.resolve().parents) if folder.exists())
