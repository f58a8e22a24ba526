"""Times the ticks of the world node alone, including publishing."""

import os
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
import rclpy
from rclpy.signals import SignalHandlerOptions

from simbev_ros.ros.conventions.names import NodeName
from simbev_ros.ros.graph.domain import DomainLock
from simbev_ros.ros.graph.environment import graph_environment
from simbev_ros.ros.nodes.load_meter import LoadMeter
from simbev_ros.ros.nodes.world_node import WorldNode
from simbev_ros.scene.request import SceneRequest
from simbev_ros.schema.scene.spec import SceneSpec


@dataclass(frozen=True, slots=True)
class SceneTiming:
    """Wall time and processor time of the world node per tick of one scene, including publishing."""

    vehicles: int
    people: int
    mean_ms: float
    p99_ms: float
    cpu_ms: float


class _TickTimes(LoadMeter):
    """Records the wall and processor time of each tick, in s."""

    def __init__(self) -> None:
        super().__init__()
        self.times_s: list[tuple[float, float]] = []

    @contextmanager
    def busy(self, ticks: int = 1) -> Iterator[None]:
        wall_s, cpu_s = time.perf_counter(), time.process_time()
        yield
        self.times_s.append((time.perf_counter() - wall_s, time.process_time() - cpu_s))


def timed_scenes(specs: Sequence[SceneSpec]) -> list[SceneTiming]:
    """Play scenes one after the other as fast as possible, without other nodes to wait for."""
    with DomainLock() as lock:
        os.environ.update(graph_environment(lock.domain))
        rclpy.init(domain_id=lock.domain, signal_handler_options=SignalHandlerOptions.NO)
        try:
            return [_timed_scene(SceneRequest(spec=spec)) for spec in specs]
        finally:
            rclpy.shutdown()


def _timed_scene(request: SceneRequest) -> SceneTiming:
    node = WorldNode(NodeName("world"))
    meter = node.meter = _TickTimes()
    try:
        node.start(request)
        node.advance()
    finally:
        node.close()
        node.destroy_node()
    spec = request.spec
    wall_ms, cpu_ms = 1000.0 * np.array(meter.times_s)[-spec.ticks :].T
    return SceneTiming(
        vehicles=len(spec.vehicles),
        people=len(spec.pedestrians),
        mean_ms=float(wall_ms.mean()),
        p99_ms=float(np.percentile(wall_ms, 99)),
        cpu_ms=float(cpu_ms.mean()),
    )
