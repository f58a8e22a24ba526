"""Times a whole graph from outside: ticks per second, and time and memory of each process."""

import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from simbev_ros.config.scenario import Scenario
from simbev_ros.graph.session import GraphSession
from simbev_ros.production.drawing import draw_scenes
from simbev_ros.production.observer import SILENT, ProductionObserver
from simbev_ros.production.play import play_on


@dataclass(frozen=True, slots=True)
class ProcessTiming:
    """One process: wall time in callbacks and processor time, both per tick, and resident memory at the end."""

    name: str
    busy_ms: float
    cpu_ms: float
    memory_mib: float


@dataclass(frozen=True, slots=True)
class GraphTiming:
    """Speed of a graph, without loading and warm-up."""

    ticks: int
    ticks_per_s: float
    processes: list[ProcessTiming]


def timed_graph(scenario: Scenario, dataset: Path | None, observer: ProductionObserver = SILENT) -> GraphTiming:
    """Play the first scene of a configuration in lockstep and time it from the second tick on.

    Args:
        scenario: The configuration.
        dataset: Folder to record into; None: nothing is recorded.
        observer: Receives the progress.

    Raises:
        InputError: The scene cannot be drawn or played.
        GraphError: A node died or fell silent.
    """
    spec = draw_scenes(scenario, observer)[0]
    start: tuple[float, int, dict[str, float]] | None = None
    with GraphSession(scenario, dataset=dataset) as session:

        def start_at_second_tick(tick: int | None) -> None:
            nonlocal start
            if tick is not None and tick >= 1 and start is None:
                start = time.monotonic(), tick, session.cpu_s()

        end = play_on(session, spec, observer, on_tick=start_at_second_tick)
        assert start is not None
        start_s, start_tick, start_cpu_s = start
        ticks = end.tick - start_tick
        rate = ticks / (time.monotonic() - start_s)
        return GraphTiming(ticks, rate, _process_timings(session, start_cpu_s, ticks))


def _process_timings(session: GraphSession, start_cpu_s: Mapping[str, float], ticks: int) -> list[ProcessTiming]:
    cpu_s = session.cpu_s()
    return [
        ProcessTiming(
            name=name,
            busy_ms=session.monitor.busy_ms(name.split("+")),
            cpu_ms=1000 * (cpu_s[name] - start_cpu_s[name]) / ticks,
            memory_mib=memory_mib,
        )
        for name, memory_mib in session.memory_mib().items()
    ]
