"""Reports of a worker's observer: every event arrives as it was, progress is thinned out, and a scene is sent once."""

import inspect
import pickle
from typing import Any

import pytest
from made_up_scene import made_up_spec

from simbev_ros.production import ProductionObserver
from simbev_ros.production.workers import messages
from simbev_ros.production.workers.messages import Report, ReportingObserver
from simbev_ros.scene.ending import DURATION, SceneEnd

EVENTS = sorted(name for name in vars(ProductionObserver) if not name.startswith("_"))
SPEC = made_up_spec([])


class Recorder(ProductionObserver):
    """Keeps name and arguments of every call."""

    def __init__(self) -> None:
        self.calls: list[tuple[str, tuple[Any, ...]]] = []
        for event in EVENTS:
            setattr(self, event, lambda *arguments, event=event: self.calls.append((event, arguments)))


@pytest.mark.parametrize("event", EVENTS)
def test_every_event_arrives_with_its_arguments(event: str) -> None:
    names = list(inspect.signature(getattr(ProductionObserver, event)).parameters)[1:]
    arguments = tuple(SPEC if name == "spec" else f"the {name}" for name in names)
    sent: list[Report] = []
    getattr(ReportingObserver(sent.append), event)(*arguments)
    (report,) = pickle.loads(pickle.dumps(sent))
    recorder = Recorder()
    report.repeat(recorder, SPEC)
    assert recorder.calls == [(event, arguments)]


def test_a_scene_is_sent_only_when_it_starts() -> None:
    sent: list[Report] = []
    observer = ReportingObserver(sent.append)
    observer.scene_started(SPEC)
    observer.scene_progressed(SPEC, 0)
    observer.scene_ended(SPEC, SceneEnd(scene=SPEC.name, tick=2, reason=DURATION))
    sizes = [len(pickle.dumps(report)) for report in sent]
    assert len(sizes) == 3 and max(sizes[1:]) < 1000 < sizes[0]


def test_progress_is_sent_four_times_per_second(monkeypatch: pytest.MonkeyPatch) -> None:
    now_s = 100.0
    monkeypatch.setattr(messages.time, "monotonic", lambda: now_s)
    sent: list[Report] = []
    observer = ReportingObserver(sent.append)
    for tick in range(100):
        observer.scene_progressed(SPEC, tick)
        now_s += 1 / 32
    assert [report.arguments[1] for report in sent] == list(range(0, 100, 8))
