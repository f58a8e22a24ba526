"""Runs a graph for a long time and samples what its processes hold: a long live scene, and many short scenes."""

import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import chain, groupby, zip_longest
from pathlib import Path
from typing import Self

from simbev_ros.config.load import load_scenario
from simbev_ros.config.scenario import MapScenes, Scenario, Timing
from simbev_ros.production.drawing import draw_scenes
from simbev_ros.production.observer import SILENT, ProductionObserver
from simbev_ros.production.play import play_on
from simbev_ros.production.surroundings import build_surroundings
from simbev_ros.recording.layout import scene_folder
from simbev_ros.ros.graph.environment import graph_environment
from simbev_ros.ros.graph.session import GraphSession
from simbev_ros.ros.nodes.lifeline import SUPERVISOR_VARIABLE
from simbev_ros.schema.scene.spec import SceneSpec
from tools.bench.growth import Trend, trends
from tools.bench.resource_use import ResourceSampler, ResourceUse

MIN_SCENES = 5
"""Fewer scenes give too few samples for a trend."""

_CONFIG = Path(__file__).with_name("endurance.yaml")
_MAX_SAMPLES, _MIN_PERIOD_S = 400, 1.0


@dataclass(frozen=True, slots=True)
class EnduranceRun:
    """One run and how what its processes hold has developed.

    Attributes:
        title: What was run.
        duration_s: Wall time between first and last sample, s.
        samples: Number of samples.
        trends: Trends of all processes and folders.
    """

    title: str
    duration_s: float
    samples: int
    trends: list[Trend]

    @classmethod
    def from_samples(cls, title: str, samples: Sequence[ResourceUse]) -> Self:
        """Find the trends of a run."""
        return cls(title, samples[-1].time_s - samples[0].time_s, len(samples), trends(samples))

    def rows(self) -> list[tuple[str, ...]]:
        """For each process and folder: name, memory in MiB after warm-up, at the end, and per hour; then counts."""
        by_name = {name: list(group) for name, group in groupby(self.trends, key=lambda trend: trend.name)}
        rows: list[tuple[str, ...]] = []
        for name, (memory, *counts) in by_name.items():
            values = (f"{memory.start:.1f}", f"{memory.end:.1f}", f"{memory.per_h:+.1f}")
            rows.append((self.title, name, *values, ", ".join(map(_describe_count, counts))))
        return rows


@dataclass(frozen=True, slots=True)
class Endurance:
    """All runs of an endurance test."""

    runs: list[EnduranceRun]

    def rows(self) -> list[tuple[str, ...]]:
        """The rows of all runs."""
        return [row for run in self.runs for row in run.rows()]

    def growth(self) -> list[str]:
        """A sentence for everything that grows."""
        return [
            f"{run.title}: {trend.name}: {trend.quantity} rises by {trend.rise:.1f}; allowed: {trend.max_rise:.1f}"
            for run in self.runs
            for trend in run.trends
            if trend.grows
        ]


def _describe_count(trend: Trend) -> str:
    """A count after warm-up and at the end."""
    change = f"{trend.start:.0f}" if trend.end == trend.start else f"{trend.start:.0f} to {trend.end:.0f}"
    return f"{change} {trend.quantity}"


def measure_endurance(duration_s: float, scenes: int, observer: ProductionObserver = SILENT) -> Endurance:
    """Run a live scene, then many short scenes on one graph.

    Args:
        duration_s: Duration of the live scene, s, at least 30; 0: none.
        scenes: Number of short scenes, at least ``MIN_SCENES``; 0: none.
        observer: Receives the progress.

    Raises:
        InputError: A scene cannot be drawn or played.
        DiskError: The disk is full, or nearly.
        GraphError: A node died or fell silent.
    """
    runs = []
    if duration_s:
        runs.append(EnduranceRun.from_samples(f"live, {duration_s / 60:g} min", live_endurance(duration_s, observer)))
    if scenes:
        runs.append(EnduranceRun.from_samples(f"{scenes} scenes", scenes_endurance(scenes, observer)))
    return Endurance(runs)


def endurance_scenario() -> Scenario:
    """The configuration that is played: every kind of sensor and all labels on two maps."""
    return load_scenario(str(_CONFIG))


def live_endurance(duration_s: float, observer: ProductionObserver = SILENT) -> list[ResourceUse]:
    """Stream one scene in real time to a subscriber of all sensors, and sample the graph regularly.

    Args:
        duration_s: Duration of the scene, s; a whole number of ticks.
        observer: Receives the progress.

    Raises:
        InputError: The scene cannot be drawn or played.
        GraphError: A node died or fell silent.
    """
    scenario = endurance_scenario()
    timing = Timing(tick_s=scenario.time.tick_s, warm_up_s=scenario.time.warm_up_s, duration_s=duration_s)
    scenario = scenario.model_copy(update={"time": timing, "scenes": scenario.scenes[:1]})
    specs = draw_scenes(scenario, observer)
    build_surroundings(specs, observer)
    period_s = max(duration_s / _MAX_SAMPLES, _MIN_PERIOD_S)
    session = GraphSession(scenario, live=True)
    with _temporary_folder() as folder, session, _reader(specs[0], session) as reader:
        sampler = ResourceSampler([folder, session.folder])
        next_s = 0.0

        def sample(tick: int | None) -> None:
            nonlocal next_s
            if tick is not None and time.monotonic() >= next_s:
                sampler.sample({**session.pids(), "subscriber": reader})
                next_s = time.monotonic() + period_s

        play_on(session, specs[0], observer, on_tick=sample)
        return sampler.samples


def scenes_endurance(scenes: int, observer: ProductionObserver = SILENT) -> list[ResourceUse]:
    """Record short scenes, which alternate between maps, on one graph, and sample it at the end of each scene.

    Args:
        scenes: Number of scenes.
        observer: Receives the progress.

    Raises:
        InputError: A scene cannot be drawn or played.
        DiskError: The disk is full, or nearly.
        GraphError: A node died or fell silent.
    """
    scenario = endurance_scenario()
    specs = _alternating_scenes(scenario, scenes, observer)
    build_surroundings(specs, observer)
    with tempfile.TemporaryDirectory(prefix="simbev_ros-bench-") as parent:
        dataset = Path(parent) / "dataset"
        session = GraphSession(scenario, dataset=dataset)
        with _temporary_folder() as folder, session:
            sampler = ResourceSampler([folder, session.folder])
            for spec in specs:
                play_on(session, spec, observer)
                sampler.sample(session.pids())
                shutil.rmtree(scene_folder(dataset, spec.split, spec.name))
            return sampler.samples


def _alternating_scenes(scenario: Scenario, scenes: int, observer: ProductionObserver) -> list[SceneSpec]:
    """Draw scenes such that each is on another map than the one before."""
    maps = [each.map for each in scenario.scenes]
    counts = [scenes // len(maps) + (index < scenes % len(maps)) for index in range(len(maps))]
    wanted = tuple(MapScenes(map=name, train=count) for name, count in zip(maps, counts, strict=True) if count)
    specs = draw_scenes(scenario.model_copy(update={"scenes": wanted}), observer)
    by_map = [[spec for spec in specs if spec.map.name == name] for name in maps]
    return [spec for spec in chain.from_iterable(zip_longest(*by_map)) if spec is not None]


@contextmanager
def _temporary_folder() -> Iterator[Path]:
    """A folder in which the processes that are started meanwhile make their temporary files.

    The graph's own folder and the lock of its domain are made before, where other graphs find them.
    """
    before, variable = tempfile.tempdir, os.environ.get("TMPDIR")
    with tempfile.TemporaryDirectory(prefix="simbev_ros-bench-") as folder:
        tempfile.tempdir = os.environ["TMPDIR"] = folder
        try:
            yield Path(folder)
        finally:
            tempfile.tempdir = before
            if variable is None:
                del os.environ["TMPDIR"]
            else:
                os.environ["TMPDIR"] = variable


@contextmanager
def _reader(spec: SceneSpec, session: GraphSession) -> Iterator[int]:
    """A process that subscribes to all sensors of a scene; yields its id."""
    file = session.folder / "scene.json"
    file.write_text(spec.model_dump_json(), encoding="utf-8")
    command = [sys.executable, "-m", "tools.bench.topic_reader", str(file)]
    own = {SUPERVISOR_VARIABLE: str(os.getpid())}
    with subprocess.Popen(command, env={**os.environ, **graph_environment(session.domain), **own}) as reader:
        try:
            yield reader.pid
        finally:
            reader.terminate()
