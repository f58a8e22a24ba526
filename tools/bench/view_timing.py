"""Times a graph with the viewer of running graphs: while the viewer runs, is stopped, or has a stopped server."""

import os
import signal
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from threading import Event, Thread

from simbev_ros.config.scenario import Scenario, Timing
from simbev_ros.foundation.errors import SimbevError
from simbev_ros.foundation.threads import usable_cores
from simbev_ros.production.drawing import draw_scenes
from simbev_ros.production.observer import SILENT, ProductionObserver
from simbev_ros.production.play import play_on
from simbev_ros.production.surroundings import build_surroundings
from simbev_ros.ros.graph.session import GraphSession
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.show.rerun.live.viewer_process import ADDRESS, SHOWING, ViewerProcess

_START_TIMEOUT_S = 60.0
_FIRST_TICK = 10
"""Timing begins after it at the earliest; in cases with a viewer, when the first frame is shown."""
ALONE, RUNNING, STOPPED, SERVER_STOPPED = "no viewer", "viewer", "stopped viewer", "viewer with stopped server"
_STOPPED: Mapping[str, Callable[[ViewerProcess], list[int]]] = {
    ALONE: lambda _: [],
    RUNNING: lambda _: [],
    STOPPED: lambda viewer: viewer.pids()[:1],
    SERVER_STOPPED: lambda viewer: viewer.pids()[1:],
}
"""Processes that are stopped once a frame is shown, by case."""


@dataclass(frozen=True, slots=True)
class SceneSpeed:
    """One scene: ticks per second of wall time, and processor time of all processes of the graph per tick."""

    ticks_per_s: float
    cpu_ms: float


@dataclass(frozen=True, slots=True)
class ViewTiming:
    """Speed of a graph with and without a viewer.

    Attributes:
        ticks: Number of ticks of each scene.
        cores: Number of cores that graph and viewer share.
        scenes: Scenes by case, one for each round.
    """

    ticks: int
    cores: int
    scenes: dict[str, list[SceneSpeed]]

    def rows(self) -> list[tuple[str, ...]]:
        """Rows of a table, one for each case: medians, and medians of the ratios to no viewer, round by round."""
        return [
            (
                case,
                f"{median(each.ticks_per_s for each in scenes):.2f}",
                f"{100 * self._ratio(case, 'ticks_per_s'):.1f} %",
                f"{median(each.cpu_ms for each in scenes):.1f}",
                f"{100 * self._ratio(case, 'cpu_ms'):.1f} %",
            )
            for case, scenes in self.scenes.items()
        ]

    def _ratio(self, case: str, value: str) -> float:
        pairs = zip(self.scenes[case], self.scenes[ALONE], strict=True)
        return median(getattr(scene, value) / getattr(alone, value) for scene, alone in pairs)


def timed_view(
    scenario: Scenario, ticks: int, rounds: int, folder: Path, observer: ProductionObserver = SILENT
) -> ViewTiming:
    """Play the first scene of a configuration in lockstep in each case, in turns, and record it.

    Args:
        scenario: The configuration.
        ticks: Number of ticks of a scene.
        rounds: Number of times that each case is timed.
        folder: Folder for the dataset and temporary files.
        observer: Receives the progress.

    Raises:
        InputError: The scene cannot be drawn or played.
        GraphError: A node died or fell silent.
        SimbevError: The viewer does not start, or shows nothing.
    """
    timing = Timing(
        tick_s=scenario.time.tick_s, warm_up_s=scenario.time.warm_up_s, duration_s=ticks * scenario.time.tick_s
    )
    scenario = scenario.model_copy(update={"time": timing, "scenes": scenario.scenes[:1]})
    spec = draw_scenes(scenario, observer)[0]
    build_surroundings([spec], observer)
    speeds: dict[str, list[SceneSpeed]] = {case: [] for case in _STOPPED}
    with GraphSession(scenario, dataset=folder / "dataset") as session:
        _play(session, spec, ALONE, folder, observer)  # the first scene on a graph loads what later ones find
        for turn in range(rounds):
            for index, case in enumerate(speeds):
                copy = spec.model_copy(update={"number": spec.number + 1 + turn * len(speeds) + index})
                speeds[case].append(_play(session, copy, case, folder, observer))
    return ViewTiming(ticks, usable_cores(), speeds)


def _play(session: GraphSession, spec: SceneSpec, case: str, folder: Path, observer: ProductionObserver) -> SceneSpeed:
    """Play a scene in one case and time it from the moment at which the viewer shows it."""
    start: tuple[int, float, float] | None = None

    def start_when_shown(tick: int | None) -> None:
        nonlocal start
        if start is None and tick is not None and tick >= _FIRST_TICK and is_shown.is_set():
            for pid in [] if viewer is None else _STOPPED[case](viewer):
                os.kill(pid, signal.SIGSTOP)
            start = tick, time.monotonic(), sum(session.cpu_s().values())

    is_shown = Event()
    with nullcontext() if case == ALONE else _started_viewer(session.domain, folder, is_shown) as viewer:
        if viewer is None:
            is_shown.set()
        end = play_on(session, spec, observer, on_tick=start_when_shown)
        end_s, end_cpu_s = time.monotonic(), sum(session.cpu_s().values())
    if start is None or end.tick <= start[0]:
        raise SimbevError(f"{case}: shows nothing before the scene ends; more ticks may help")
    start_tick, start_s, start_cpu_s = start
    ticks = end.tick - start_tick
    return SceneSpeed(ticks / (end_s - start_s), 1000.0 * (end_cpu_s - start_cpu_s) / ticks)


@contextmanager
def _started_viewer(domain: int, folder: Path, is_shown: Event) -> Iterator[ViewerProcess]:
    """A viewer that waits for a scene; ``is_shown`` is set when it shows the first frame."""
    is_ready, lines = Event(), list[str]()

    def read() -> None:
        for line in viewer.lines():
            lines.append(line)
            if line.startswith(ADDRESS):
                is_ready.set()
            if line.startswith(SHOWING):
                is_shown.set()

    with ViewerProcess(domain, 0, folder, {}) as viewer:
        Thread(target=read, daemon=True).start()
        if not is_ready.wait(_START_TIMEOUT_S):
            raise SimbevError(f"the viewer does not start: {lines[-1] if lines else 'it says nothing'}")
        yield viewer
