"""Times whole scenes of a dataset: processor time of the graph's processes in each phase, from start to end.

One graph records a first scene, a second one on the same town, and one on another town; everything that is built once
is in the cache. Several such graphs side by side show what workers of one machine cost each other.
"""

import json
import math
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean
from tempfile import TemporaryDirectory
from typing import Any, TypeVar

import psutil

from simbev_ros.assets.actors.catalog import load_models
from simbev_ros.assets.regions.static_cache import load_static_scene, load_streetside
from simbev_ros.config.load import load_scenario
from simbev_ros.config.scenario import MapScenes, Scenario
from simbev_ros.dataset.plan import PlannedEntry
from simbev_ros.foundation.errors import GraphError
from simbev_ros.maps.build import load_network
from simbev_ros.production.drawing import PlannedSceneDrawer, draw_scenes
from simbev_ros.production.observer import SILENT, ProductionObserver
from simbev_ros.production.play import play_on
from simbev_ros.production.scene_cost import CostMeter
from simbev_ros.production.surroundings import build_surroundings
from simbev_ros.ros.graph.monitor import SUPERVISOR
from simbev_ros.ros.graph.session import GraphSession
from simbev_ros.scene.drawing.draw_scene import planned_scenes
from simbev_ros.scene.reach import loaded_reach
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.simulation.annotation.scene_annotator import MeshAnnotators
from simbev_ros.simulation.render.renderer import Renderer
from simbev_ros.simulation.world.simulation import Simulation

CONFIG = Path(__file__).with_name("scene.yaml")
CASES = ("first scene", "same town", "other town")
BEFORE_FIRST_TICK = ("draw", "load", "lead-in")
"""Phases between the end of a scene and the first tick of the next one."""
_QUIET_S, _QUIET_CPU_S = 1.0, 0.1
"""A graph has started when its processes need less than this processor time in a while."""

_SERVERS = 2
"""Supervisor and fork server, which run before any node does."""
_T = TypeVar("_T")
_Phase = Mapping[str, float]
"""Processor time by process, s."""


@dataclass(frozen=True, slots=True)
class SceneCosts:
    """Costs of the scenes, means over all workers.

    Attributes:
        workers: Number of graphs side by side.
        memory_mib: Peak memory of one graph; pages that processes share count in parts.
        start: Phases before the first scene: imports of this process, and start of all others.
        scenes: Phases of each scene, by its case.
        parts: What loading consists of, s: the same work, done by this process alone after the graph has ended.
    """

    workers: int
    memory_mib: float
    start: Mapping[str, _Phase]
    scenes: Mapping[str, Mapping[str, _Phase]]
    parts: Mapping[str, Mapping[str, float]]

    def rows(self) -> list[tuple[str, ...]]:
        """Rows of a table: each phase, and below it the processes; then the parts of loading."""
        cases = {case: {**(self.start if case == CASES[0] else {}), **self.scenes[case]} for case in self.scenes}
        rows = [("all phases", *_cells(sum(map(_total, phases.values())) for phases in cases.values()))]
        between = (sum(_total(each[phase]) for phase in BEFORE_FIRST_TICK) for each in self.scenes.values())
        rows.append((", ".join(BEFORE_FIRST_TICK), *_cells(between)))
        for phase in dict.fromkeys(phase for phases in cases.values() for phase in phases):
            found = [phases.get(phase, {}) for phases in cases.values()]
            rows.append((phase, *_cells(map(_total, found))))
            for process in dict.fromkeys(name for each in found for name in each):
                rows.append((f"  {process}", *_cells(each.get(process, 0.0) for each in found)))
        for part in self.parts[CASES[0]]:
            rows.append((f"part: {part}", *_cells(each[part] for each in self.parts.values())))
        return rows


def scene_scenario(maps: Sequence[str]) -> Scenario:
    """The configuration: two scenes on the first map and one on the second one."""
    first, second = maps
    scenes = (MapScenes(map=first, train=2), MapScenes(map=second, train=1))
    return load_scenario(str(CONFIG)).model_copy(update={"scenes": scenes})


def timed_scenes(maps: Sequence[str], workers: int = 1, observer: ProductionObserver = SILENT) -> SceneCosts:
    """Time scenes on two maps.

    Args:
        maps: Two towns or map files.
        workers: Number of graphs side by side, each in a process of its own if there are several.
        observer: Receives the progress of what is built first.

    Raises:
        InputError: A scene cannot be drawn.
        GraphError: A node or a worker died.
    """
    if workers == 1:
        return _timed_graph(maps, observer)
    build_surroundings(draw_scenes(scene_scenario(maps), observer), observer)
    command = [sys.executable, "-m", "tools.bench", "scene", "--maps", ",".join(maps), "--json"]
    running = [subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for _ in range(workers)]
    outputs = [process.communicate()[0] for process in running]
    if any(process.returncode for process in running):
        raise GraphError("a worker of the benchmark has failed")
    return SceneCosts(**_mean([json.loads(output) for output in outputs]) | {"workers": workers})


def _timed_graph(maps: Sequence[str], observer: ProductionObserver) -> SceneCosts:
    """Time the scenes on one graph that this process starts."""
    imports = {SUPERVISOR: time.process_time()}
    scenario = scene_scenario(maps)
    entries = [
        PlannedEntry(number=scene.number, map=scene.map.name, split=scene.split) for scene in planned_scenes(scenario)
    ]
    build_surroundings(draw_scenes(scenario, observer), observer)
    drawer, scenes, specs = (
        PlannedSceneDrawer(scenario, observer),
        dict[str, dict[str, _Phase]](),
        dict[str, SceneSpec](),
    )
    with (
        TemporaryDirectory(prefix="simbev_ros-bench-") as folder,
        GraphSession(scenario, dataset=Path(folder)) as session,
    ):
        clock = _PhaseClock(session)
        _await_quiet(session)
        start = {"imports": imports, "start": clock.phase()}
        meter = CostMeter(session.pids().values())
        for case, entry in zip(CASES, entries, strict=True):
            specs[case] = drawer.draw(entry)
            build_surroundings([specs[case]], observer)
            scenes[case] = _timed_scene(session, specs[case], clock)
            meter.look(session.pids().values())
        memory_mib = meter.cost(session.pids().values(), 1).memory_mib
        nodes_s, own_s = clock.total_s() - time.process_time(), time.process_time()
    times = os.times()
    ending = {SUPERVISOR: time.process_time() - own_s, "nodes": times.children_user + times.children_system - nodes_s}
    scenes[CASES[-1]]["end of graph"] = ending
    return SceneCosts(1, memory_mib, start, scenes, {case: _timed_parts(spec) for case, spec in specs.items()})


class _PhaseClock:
    """Divides the processor time of a graph's processes into phases that follow one another."""

    def __init__(self, session: GraphSession) -> None:
        self._session, self._before_s = session, {SUPERVISOR: time.process_time()}

    def total_s(self) -> float:
        """Processor time of all processes up to now."""
        return sum(self._read().values())

    def phase(self) -> dict[str, float]:
        """Processor time of each process since the last call, s."""
        now_s, before_s = self._read(), self._before_s
        self._before_s = now_s
        return {name: time_s - before_s.get(name, 0.0) for name, time_s in now_s.items()}

    def _read(self) -> dict[str, float]:
        times = {name: psutil.Process(pid).cpu_times() for name, pid in self._session.pids().items()}
        return {name: each.user + each.system for name, each in times.items()}


def _await_quiet(session: GraphSession) -> None:
    """Wait until all processes have started, after which they need hardly any processor time."""
    clock = _PhaseClock(session)
    before_s = -math.inf
    while (now_s := clock.total_s()) - before_s > _QUIET_CPU_S or len(session.pids()) == _SERVERS:
        before_s = now_s
        session.wait(_QUIET_S)


def _timed_scene(session: GraphSession, spec: SceneSpec, clock: _PhaseClock) -> dict[str, _Phase]:
    """Play a scene; return the processor time of each phase and process."""
    phases: dict[str, _Phase] = {"draw": clock.phase()}
    ahead = [("load", spec.loaded_tick), ("lead-in", -1), ("ticks", spec.ticks - 1)]

    def look(tick: int | None) -> None:
        while ahead and tick is not None and tick >= ahead[0][1]:
            phases[ahead.pop(0)[0]] = clock.phase()

    play_on(session, spec, on_tick=look)  # a display of the progress would cost as much as the supervisor
    phases["close"] = clock.phase()
    return phases


def _timed_parts(spec: SceneSpec) -> dict[str, float]:
    """Processor time of the parts of loading, s."""
    times: dict[str, float] = {}

    def timed(name: str, work: Callable[[], _T]) -> _T:
        began_s = time.process_time()
        result = work()
        times[name] = time.process_time() - began_s
        return result

    network = timed("map", lambda: load_network(spec.map))
    reach = loaded_reach(spec, network)
    models = timed("models", load_models)
    static = timed("regions", lambda: load_static_scene(spec.map, network, reach=reach))
    timed("uploads and shaders", lambda: Renderer(static, models)).close()
    timed("meshes for labels", lambda: MeshAnnotators(static, models))
    streetside = load_streetside(spec.map, network, reach=reach)
    with timed("traffic", lambda: Simulation(spec, network, *streetside[1:])) as simulation:
        timed("warm-up of traffic", lambda: [simulation.step() for _ in range(spec.warm_up_ticks)])
    return times


def _mean(results: Sequence[Any]) -> Any:
    """Means of numbers in nested dictionaries of the same structure."""
    if not isinstance(results[0], dict):
        return fmean(results)
    return {key: _mean([each[key] for each in results]) for key in results[0]}


def _total(phase: _Phase) -> float:
    return sum(phase.values())


def _cells(times_s: Iterable[float]) -> list[str]:
    return [f"{time_s:.2f}" for time_s in times_s]
