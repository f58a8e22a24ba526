"""Figures of a production as Ray metrics, which Prometheus reads from the cluster's nodes and Ray's dashboard shows."""

import time
from typing import Any

from simbev_ros.production.events import (
    DatasetStarted,
    ProductionEvent,
    SceneEnded,
    SceneFailed,
    SceneMade,
    SceneProgressed,
    SceneRetried,
    SceneStarted,
)
from simbev_ros.production.observer import ProductionObserver


class RayMetrics(ProductionObserver):
    """Counts scenes, frames and bytes.

    The names in Prometheus are ``ray_simbev_scenes_planned``, ``…_made``, ``…_failed``, ``…_retried``, ``…_running``,
    ``ray_simbev_frames``, ``ray_simbev_frames_per_second`` and ``ray_simbev_dataset_bytes``, with the tag ``dataset``.

    Args:
        dataset: Name of the dataset.
    """

    def __init__(self, dataset: str) -> None:
        from ray.util.metrics import Gauge

        def gauge(name: str, description: str) -> Any:
            made = Gauge(f"simbev_{name}", description, ("dataset",))
            made.set_default_tags({"dataset": dataset})
            return made

        self._planned = gauge("scenes_planned", "Scenes to make in this run")
        self._made = gauge("scenes_made", "Scenes that were made in this run")
        self._failed = gauge("scenes_failed", "Scenes that could not be made")
        self._retried = gauge("scenes_retried", "Attempts that failed or lost their worker")
        self._running = gauge("scenes_running", "Scenes that are being played")
        self._frames = gauge("frames", "Frames that were simulated in this run")
        self._rate = gauge("frames_per_second", "Frames per second since the start of this run")
        self._bytes = gauge("dataset_bytes", "Size of all scenes of the dataset")
        self._counts: dict[Any, int] = {}
        self._ticks: dict[str, int] = {}
        self._began_s = time.monotonic()

    def notify(self, event: ProductionEvent) -> None:
        """Count what the event reports."""
        match event:
            case DatasetStarted(scenes, dataset_bytes):
                self._planned.set(scenes)
                self._bytes.set(dataset_bytes)
                for gauge in (self._made, self._failed, self._retried, self._running, self._frames):
                    self._add(gauge, 0)
            case SceneStarted(spec):
                self._ticks[spec.name] = -1
                self._running.set(len(self._ticks))
            case SceneProgressed(scene, tick):
                self._count_frames(scene, tick)
            case SceneEnded(scene, end):
                self._count_frames(scene, None if end is None else end.tick)
                self._ticks.pop(scene, None)
                self._running.set(len(self._ticks))
            case SceneMade(_, dataset_bytes):
                self._add(self._made, 1)
                self._bytes.set(dataset_bytes)
            case SceneRetried():
                self._add(self._retried, 1)
            case SceneFailed():
                self._add(self._failed, 1)
            case _:
                pass  # no metric follows from it

    def _count_frames(self, scene: str, tick: int | None) -> None:
        last = self._ticks.get(scene)
        if tick is None or last is None or tick <= last:
            return
        self._ticks[scene] = tick
        self._add(self._frames, tick - last)
        self._rate.set(self._counts[self._frames] / (time.monotonic() - self._began_s))

    def _add(self, gauge: Any, amount: int) -> None:
        self._counts[gauge] = self._counts.get(gauge, 0) + amount
        gauge.set(self._counts[gauge])
