"""Times a whole graph: ticks per second, memory of each process, and the time that parts of its work take."""

import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import get_args

from simbev_ros.config.load import load_scenario
from simbev_ros.config.rendering import Quality
from simbev_ros.config.scenario import MapScenes, Scenario, Timing
from simbev_ros.config.weather import WEATHER_PARAMETERS, WeatherConfig
from simbev_ros.foundation.threads import usable_cores
from simbev_ros.production.drawing import draw_scenes
from simbev_ros.production.observer import SILENT, ProductionObserver
from simbev_ros.production.play import play_on
from simbev_ros.ros.graph.session import GraphSession
from simbev_ros.ros.nodes.load_meter import BUSY, Part, part_keys

DAY = WeatherConfig.model_validate(
    {
        **dict.fromkeys(WEATHER_PARAMETERS, 0.0),
        "cloudiness": 20,
        "wind_intensity": 10,
        "sun_azimuth_deg": 160,
        "sun_altitude_deg": 45,
        "fog_falloff": 1,
        "season": "summer",
    }
)
"""Weather of benchmarks: a clear day."""


@dataclass(frozen=True, slots=True)
class PartTiming:
    """A part of a process's work: wall time of its threads, which may work side by side, and their processor time."""

    name: str
    wall_ms: float
    cpu_ms: float


@dataclass(frozen=True, slots=True)
class ProcessTiming:
    """One process: wall time in callbacks and processor time, both per tick, and resident memory at the end.

    Attributes:
        parts: Parts of its work per tick; the last one is the processor time of all else, such as that of threads of
            OpenGL and of the middleware.
    """

    name: str
    busy_ms: float
    cpu_ms: float
    memory_mib: float
    parts: list[PartTiming]


@dataclass(frozen=True, slots=True)
class GraphTiming:
    """Speed of a graph, without loading and warm-up.

    Attributes:
        ticks: Number of ticks that were timed.
        ticks_per_s: Speed.
        cores: Number of cores that the graph could use.
        processes: The processes of the graph.
        slowest: Name of the process that is busy for the longest at a tick.
        ticks_per_s_of_slowest: Speed if nothing had to wait but for that process.
        ticks_per_s_of_cores: Speed if every core was always busy with the graph.
    """

    ticks: int
    ticks_per_s: float
    cores: int
    processes: list[ProcessTiming]
    slowest: str
    ticks_per_s_of_slowest: float
    ticks_per_s_of_cores: float

    def rows(self) -> list[tuple[str, ...]]:
        """Rows of a table: each process, and below it the parts of its work."""
        rows = []
        for each in self.processes:
            rows.append((each.name, f"{each.busy_ms:.1f}", f"{each.cpu_ms:.1f}", f"{each.memory_mib:.0f}"))
            rows += [
                (f"  {part.name}", f"{part.wall_ms:.1f}" if part.wall_ms else "", f"{part.cpu_ms:.1f}", "")
                for part in each.parts
            ]
        cpu_ms, memory_mib = (sum(getattr(each, name) for each in self.processes) for name in ("cpu_ms", "memory_mib"))
        return [*rows, ("together", "", f"{cpu_ms:.1f}", f"{memory_mib:.0f}")]

    def bottleneck(self) -> str:
        """A sentence on what limits the speed."""
        return (
            f"{self.cores} cores that never wait would reach {self.ticks_per_s_of_cores:.2f} ticks/s; the slowest "
            f"process, {self.slowest}, alone {self.ticks_per_s_of_slowest:.2f}"
        )


def full_rig(quality: Quality) -> Scenario:
    """The paper's rig in Town03 by day, with 60 vehicles and 60 pedestrians."""
    paper = load_scenario("paper")
    return paper.model_copy(
        update={
            "scenes": (MapScenes(map="Town03", train=1),),
            "traffic": paper.traffic.model_copy(update={"vehicles": 60, "pedestrians": 60}),
            "weather": DAY,
            "rendering": paper.rendering.model_copy(update={"quality": quality}),
        }
    )


def shortened(scenario: Scenario, ticks: int) -> Scenario:
    """The first scenes of a configuration, shortened to a number of ticks."""
    time = scenario.time
    timing = Timing(tick_s=time.tick_s, warm_up_s=time.warm_up_s, duration_s=ticks * time.tick_s)
    return scenario.model_copy(update={"time": timing, "scenes": scenario.scenes[:1]})


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
        processes = _process_timings(session, start_cpu_s, ticks)
    slowest, cores = max(processes, key=lambda each: each.busy_ms), usable_cores()
    cpu_ms = sum(each.cpu_ms for each in processes)
    return GraphTiming(
        ticks, rate, cores, processes, slowest.name, 1000.0 / max(slowest.busy_ms, 1e-3), 1000.0 * cores / cpu_ms
    )


def _process_timings(session: GraphSession, start_cpu_s: Mapping[str, float], ticks: int) -> list[ProcessTiming]:
    cpu_s = session.cpu_s()
    timings = []
    for name, memory_mib in session.memory_mib().items():
        load_ms = session.monitor.load_ms(name.split("+"))
        cpu_ms = 1000.0 * (cpu_s[name] - start_cpu_s[name]) / ticks
        timings.append(ProcessTiming(name, load_ms[BUSY], cpu_ms, memory_mib, _parts(load_ms, cpu_ms)))
    return timings


def _parts(load_ms: Mapping[str, float], cpu_ms: float) -> list[PartTiming]:
    """The parts of a process's work that take time, and the rest of its processor time."""
    timed = [PartTiming(part, *(load_ms[key] for key in part_keys(part))) for part in get_args(Part)]
    parts = [part for part in timed if part.wall_ms > 0.0]
    return [*parts, PartTiming("all else", 0.0, max(cpu_ms - sum(part.cpu_ms for part in parts), 0.0))]
