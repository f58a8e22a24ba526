"""Events of production: they reach every observer; workers send each as it is, thin out progress, and a scene once."""

import pickle
from typing import Any, get_args, get_type_hints

import pytest
from made_up_scene import made_up_spec

from simbev_ros.production import ProductionObserver
from simbev_ros.production.events import ProductionEvent, SceneEnded, SceneProgressed, SceneStarted
from simbev_ros.production.observer import SeveralObservers
from simbev_ros.production.workers import messages
from simbev_ros.production.workers.messages import Report, ReportingObserver
from simbev_ros.scene.ending import DURATION, SceneEnd

SPEC = made_up_spec([])


class Recorder(ProductionObserver):
    """Keeps every event."""

    def __init__(self) -> None:
        self.events: list[ProductionEvent] = []

    def notify(self, event: ProductionEvent) -> None:
        self.events.append(event)


def made_up(kind: type[Any]) -> ProductionEvent:
    """An event of a kind, with its scene or the names of its other fields."""
    fields = [name for name in get_type_hints(kind) if not name.startswith("_")]
    event: ProductionEvent = kind(*(SPEC if name == "spec" else f"the {name}" for name in fields))
    return event


@pytest.mark.parametrize("kind", get_args(ProductionEvent), ids=lambda kind: kind.__name__)
def test_every_event_arrives_as_it_was_at_each_observer(kind: type[Any]) -> None:
    sent: list[Report] = []
    ReportingObserver(sent.append).notify(made_up(kind))
    (report,) = pickle.loads(pickle.dumps(sent))
    first, second = Recorder(), Recorder()
    SeveralObservers(first, second).notify(report.event)
    assert first.events == second.events == [made_up(kind)]


def test_a_scene_is_sent_only_when_it_starts() -> None:
    sent: list[Report] = []
    observer = ReportingObserver(sent.append)
    observer.notify(SceneStarted(SPEC))
    observer.notify(SceneProgressed(SPEC.name, 0))
    observer.notify(SceneEnded(SPEC.name, SceneEnd(scene=SPEC.name, tick=2, reason=DURATION)))
    sizes = [len(pickle.dumps(report)) for report in sent]
    assert len(sizes) == 3 and max(sizes[1:]) < 1000 < sizes[0]


def test_progress_is_sent_four_times_per_second(monkeypatch: pytest.MonkeyPatch) -> None:
    now_s = 100.0
    monkeypatch.setattr(messages.time, "monotonic", lambda: now_s)
    sent: list[Report] = []
    observer = ReportingObserver(sent.append)
    for tick in range(100):
        observer.notify(SceneProgressed(SPEC.name, tick))
        now_s += 1 / 32
    assert [report.event for report in sent] == [SceneProgressed(SPEC.name, tick) for tick in range(0, 100, 8)]
