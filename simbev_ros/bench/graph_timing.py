"""Timing a graph from outside: progress over time, and what the kernel says of its processes."""

import time
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from simbev_ros.cli.scenes import drawn_scenes, scene_progress
from simbev_ros.config.scenario import Scenario
from simbev_ros.graph.session import GraphSession


@dataclass(frozen=True, slots=True)
class ProcessTiming:
    """One process: wall time inside its callbacks and processor time, both per tick; resident memory at the end."""

    name: str
    busy_ms: float
    cpu_ms: float
    memory_mib: float


@dataclass(frozen=True, slots=True)
class GraphTiming:
    """A timed graph; loading and warm-up are not counted."""

    ticks: int
    ticks_per_s: float
    processes: list[ProcessTiming]


def timed_graph(scenario: Scenario, dataset: Path | None) -> GraphTiming:
    """Play the first scene in lockstep and time it from the second tick on."""
    console = Console(stderr=True)
    spec = drawn_scenes(scenario, console)[0]
    start: tuple[float, int, dict[str, float]] | None = None
    with GraphSession(scenario, dataset=dataset) as session, scene_progress(spec, console) as bar:

        def progress(tick: int | None) -> None:
            nonlocal start
            bar(tick)
            if tick is not None and tick >= 1 and start is None:
                start = time.monotonic(), tick, session.cpu_s()

        end = session.play(spec, progress)
        assert start is not None
        ticks = end.tick - start[1]
        rate = ticks / (time.monotonic() - start[0])
        cpu_s = session.cpu_s()
        processes = [
            ProcessTiming(
                name=name,
                busy_ms=session.monitor.busy_ms(name.split("+")),
                cpu_ms=1000 * (cpu_s[name] - start[2][name]) / ticks,
                memory_mib=memory_mib,
            )
            for name, memory_mib in session.memory_mib().items()
        ]
    return GraphTiming(ticks, rate, processes)
