"""Counts of scenes, frames and bytes that Ray publishes."""

import sys

import pytest
from fake_ray import FakeGauge, install_fake_ray
from made_up_scene import made_up_spec

from simbev_ros.dataset.plan import PlannedEntry
from simbev_ros.production.events import (
    DatasetStarted,
    SceneEnded,
    SceneFailed,
    SceneMade,
    SceneProgressed,
    SceneRetried,
    SceneStarted,
)
from simbev_ros.production.workers.ray_metrics import RayMetrics
from simbev_ros.scene.ending import SceneEnd

ENTRY = PlannedEntry(number=0, map="Blocks", split="train")
FIRST, SECOND = (made_up_spec([], number=number) for number in (0, 1))


@pytest.fixture
def metrics(monkeypatch: pytest.MonkeyPatch) -> RayMetrics:
    install_fake_ray(monkeypatch)
    made = RayMetrics("first")
    made.notify(DatasetStarted(5, 1000))
    return made


@pytest.fixture
def values(metrics: RayMetrics) -> dict[str, float]:
    """The latest values, by name without prefix."""
    return gauge().values


def gauge() -> type[FakeGauge]:
    """The class of metrics, with all values."""
    made: type[FakeGauge] = sys.modules["ray.util.metrics"].Gauge
    return made


def test_counts_begin_at_zero_with_the_tag_of_the_dataset(values: dict[str, float]) -> None:
    zeros = ("scenes_made", "scenes_failed", "scenes_retried", "scenes_running", "frames")
    known = {"simbev_scenes_planned": 5, "simbev_dataset_bytes": 1000}
    assert values == {**known, **{f"simbev_{name}": 0 for name in zeros}}
    assert gauge().tags["simbev_frames"] == {"dataset": "first"}


def test_endings_of_scenes_are_counted(metrics: RayMetrics, values: dict[str, float]) -> None:
    metrics.notify(SceneMade(ENTRY, 3000))
    metrics.notify(SceneMade(ENTRY, 4000))
    metrics.notify(SceneRetried(ENTRY, "lost"))
    metrics.notify(SceneFailed(ENTRY, "bad"))
    counts = {name: values[f"simbev_scenes_{name}"] for name in ("made", "retried", "failed")}
    assert counts == {"made": 2, "retried": 1, "failed": 1} and values["simbev_dataset_bytes"] == 4000


def test_scenes_run_from_their_start_to_their_end(metrics: RayMetrics, values: dict[str, float]) -> None:
    running = []
    for change in (
        lambda: metrics.notify(SceneStarted(FIRST)),
        lambda: metrics.notify(SceneStarted(SECOND)),
        lambda: metrics.notify(SceneEnded(FIRST.name, None)),
        lambda: metrics.notify(SceneEnded(FIRST.name, None)),
        lambda: metrics.notify(SceneEnded(SECOND.name, None)),
    ):
        change()
        running.append(values["simbev_scenes_running"])
    assert running == [1, 2, 1, 1, 0]


def test_frames_of_all_scenes_are_counted_once(metrics: RayMetrics, values: dict[str, float]) -> None:
    metrics.notify(SceneStarted(FIRST))
    metrics.notify(SceneStarted(SECOND))
    for spec, tick in ((FIRST, None), (FIRST, 0), (SECOND, 4), (FIRST, 2), (FIRST, 2), (FIRST, 1)):
        metrics.notify(SceneProgressed(spec.name, tick))
    assert values["simbev_frames"] == 3 + 5 and values["simbev_frames_per_second"] > 0.0


def test_the_end_of_a_scene_counts_its_last_frames(metrics: RayMetrics, values: dict[str, float]) -> None:
    metrics.notify(SceneStarted(FIRST))
    metrics.notify(SceneProgressed(FIRST.name, 2))
    metrics.notify(SceneEnded(FIRST.name, SceneEnd(scene=FIRST.name, tick=9, reason="duration")))
    metrics.notify(SceneProgressed(FIRST.name, 50))
    assert values["simbev_frames"] == 10, "reports that come late do not count"
