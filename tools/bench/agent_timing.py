"""Times scenes with one agent and with several: what each further agent costs, and what agents share."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

from simbev_ros.config.agents import Agent
from simbev_ros.config.load import load_scenario
from simbev_ros.config.places import Near
from simbev_ros.config.scenario import MapScenes, Scenario, Timing
from simbev_ros.production.graph_timing import GraphTiming, timed_graph
from simbev_ros.production.observer import SILENT, ProductionObserver

_CONFIG = Path(__file__).with_name("agents.yaml")
_NEAR = Near(distance_m=40.0, tolerance_m=30.0)
_SENSOR_FACTOR, _WORLD_FACTOR = 2.0, 1.1
"""Two agents may cost this many times the sensors and labels of one agent, and this many times its world."""


@dataclass(frozen=True, slots=True)
class AgentCost:
    """Cost of a tick with a number of agents, medians of all rounds.

    Attributes:
        cpu_ms: Processor time per tick of the whole graph.
        world_cpu_ms: That of the world node, which does not see or label anything.
        recorder_cpu_ms: That of the recorder.
        memory_mib: Resident memory of all processes at the end; pages that processes share count once for each.
    """

    agents: int
    ticks_per_s: float
    cpu_ms: float
    world_cpu_ms: float
    recorder_cpu_ms: float
    memory_mib: float

    @property
    def sensing_cpu_ms(self) -> float:
        """Processor time per tick of sensors and labels."""
        return self.cpu_ms - self.world_cpu_ms - self.recorder_cpu_ms


@dataclass(frozen=True, slots=True)
class AgentTiming:
    """Costs of scenes with growing numbers of agents on one map."""

    map: str
    rounds: int
    costs: list[AgentCost]

    def rows(self) -> list[tuple[str, ...]]:
        """Rows of a table, one for each number of agents."""
        return [
            (
                f"{each.agents}",
                f"{each.ticks_per_s:.2f}",
                f"{each.cpu_ms:.0f}",
                f"{each.world_cpu_ms:.0f}",
                f"{each.sensing_cpu_ms:.0f}",
                f"{each.recorder_cpu_ms:.0f}",
                f"{each.memory_mib:.0f}",
            )
            for each in self.costs
        ]

    def comparison(self) -> str:
        """A sentence on two agents relative to one, if both were timed."""
        by_agents = {each.agents: each for each in self.costs}
        if not {1, 2} <= by_agents.keys():
            return ""
        one, two = by_agents[1], by_agents[2]
        return (
            f"Two agents relative to one: sensors and labels {two.sensing_cpu_ms / one.sensing_cpu_ms:.2f}, world "
            f"{two.world_cpu_ms / one.world_cpu_ms:.2f}, together {self.share_of_limit():.2f} of "
            f"{_SENSOR_FACTOR:g} x sensors and labels + {_WORLD_FACTOR:g} x world"
        )

    def share_of_limit(self) -> float:
        """Sensors, labels and world of two agents over 2.0 x sensors and labels of one + 1.1 x its world."""
        one, two = (next(each for each in self.costs if each.agents == agents) for agents in (1, 2))
        limit_ms = _SENSOR_FACTOR * one.sensing_cpu_ms + _WORLD_FACTOR * one.world_cpu_ms
        return (two.sensing_cpu_ms + two.world_cpu_ms) / limit_ms


def scene_with_agents(map_name: str, agents: int, ticks: int) -> Scenario:
    """Configuration of a short scene in which agents with equal rigs start near one another.

    Args:
        map_name: A town or a map file.
        agents: Number of agents, at least 1.
        ticks: Length of the scene.
    """
    scenario = load_scenario(str(_CONFIG))
    time = scenario.time
    timing = Timing(tick_s=time.tick_s, warm_up_s=time.warm_up_s, duration_s=ticks * time.tick_s)
    others = [Agent(name=f"car_{number}", rig=scenario.rig, near=_NEAR) for number in range(1, agents)]
    changes = {"scenes": (MapScenes(map=map_name, train=1),), "time": timing, "agents": tuple(others)}
    return scenario.model_copy(update=changes)


def timed_agents(
    map_name: str,
    numbers: Sequence[int],
    ticks: int,
    rounds: int,
    observer: ProductionObserver = SILENT,
) -> AgentTiming:
    """Record scenes with the given numbers of agents, in turns.

    Args:
        map_name: A town or a map file.
        numbers: Numbers of agents.
        ticks: Length of each scene.
        rounds: How often every number is timed.
        observer: Receives the progress.

    Raises:
        InputError: A scene cannot be drawn: the map has too few places for the agents.
        GraphError: A node died or fell silent.
    """
    timings: dict[int, list[GraphTiming]] = {number: [] for number in numbers}
    for _ in range(rounds):
        for number in numbers:
            with TemporaryDirectory(prefix="simbev_ros-bench-") as folder:
                scenario = scene_with_agents(map_name, number, ticks)
                timings[number].append(timed_graph(scenario, Path(folder) / "dataset", observer))
    return AgentTiming(map_name, rounds, [_cost(number, timings[number]) for number in numbers])


def _cost(agents: int, timings: Sequence[GraphTiming]) -> AgentCost:
    def of_node(name: str) -> float:
        return median(sum(each.cpu_ms for each in timing.processes if each.name == name) for timing in timings)

    return AgentCost(
        agents=agents,
        ticks_per_s=median(timing.ticks_per_s for timing in timings),
        cpu_ms=median(sum(each.cpu_ms for each in timing.processes) for timing in timings),
        world_cpu_ms=of_node("world"),
        recorder_cpu_ms=of_node("recorder"),
        memory_mib=median(sum(each.memory_mib for each in timing.processes) for timing in timings),
    )
