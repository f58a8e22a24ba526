"""A participant that holds up the scene is named."""

from collections.abc import Iterator

import pytest
from made_up_scene import made_up_spec
from ros_domain import DOMAIN

from simbev_ros.config.load import load_scenario
from simbev_ros.foundation.errors import GraphError
from simbev_ros.ros.conventions.names import NodeName
from simbev_ros.ros.graph import monitor as monitor_module
from simbev_ros.ros.graph.monitor import GraphMonitor
from simbev_ros.ros.graph.session import GraphSession
from simbev_ros.ros.msgs.signing import Signer
from simbev_ros.ros.msgs.stamps import header
from simbev_ros.scene.request import SceneRequest

SPEC = made_up_spec([{"type": "gnss", "name": "gnss"}])
OWN_NODES = ("world", "gnss")
TIMEOUT_S = 10.0


class FakeClock:
    """Stands in for the module ``time``."""

    now_s = 1000.0

    def monotonic(self) -> float:
        return self.now_s

    def sleep(self, time_s: float) -> None:
        self.now_s += time_s


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> FakeClock:
    fake = FakeClock()
    monkeypatch.setattr(monitor_module, "time", fake)
    return fake


@pytest.fixture
def monitor(clock: FakeClock) -> Iterator[GraphMonitor]:
    """A monitor that has requested a scene which the own node has loaded."""
    made = GraphMonitor(DOMAIN, map(NodeName, OWN_NODES), ["gnss", "planner"], Signer(None))
    made.request(SceneRequest(spec=SPEC))
    report(made, "gnss", SPEC.stamp_ns(SPEC.loaded_tick))
    yield made
    made.close()


def report(monitor: GraphMonitor, name: str, stamp_ns: int) -> None:
    monitor._on_ready(header(stamp_ns, f"{name}:{SPEC.name}"))


def wait(monitor: GraphMonitor, clock: FakeClock, duration_s: float) -> None:
    """Let time pass while the own nodes keep sending diagnostics."""
    clock.now_s += duration_s
    for name in OWN_NODES:
        monitor._note_sign_of_life(name)


def test_a_participant_that_only_repeats_its_first_report_is_named(monitor: GraphMonitor, clock: FakeClock) -> None:
    report(monitor, "gnss", SPEC.stamp_ns(0))
    report(monitor, "world", SPEC.stamp_ns(0))
    for _ in range(3):
        report(monitor, "planner", 0)
        wait(monitor, clock, 0.4 * TIMEOUT_S)
    assert monitor.silent_nodes(TIMEOUT_S) == ["planner"]


def test_when_all_have_loaded_a_world_that_does_not_start_is_named(monitor: GraphMonitor, clock: FakeClock) -> None:
    report(monitor, "planner", 0)
    wait(monitor, clock, 1.1 * TIMEOUT_S)
    assert monitor.silent_nodes(TIMEOUT_S) == ["world"]


def test_after_a_reset_the_ticks_are_counted_from_the_start(monitor: GraphMonitor, clock: FakeClock) -> None:
    for name in (*OWN_NODES, "planner"):
        report(monitor, name, SPEC.stamp_ns(2))
    assert (monitor.world.finished_by_all(), monitor.behind_world.finished_by_all()) == (2, 2)
    report(monitor, "gnss", SPEC.stamp_ns(SPEC.loaded_tick))  # only the world's reports count
    assert monitor.behind_world.finished_by_all() == 2
    for tick in (SPEC.loaded_tick, 1):
        for name in (*OWN_NODES, "planner"):
            report(monitor, name, SPEC.stamp_ns(tick))
    assert (monitor.world.finished_by_all(), monitor.behind_world.finished_by_all()) == (1, 1)


def test_several_silent_nodes_are_named_in_the_plural(monitor: GraphMonitor, clock: FakeClock) -> None:
    session = GraphSession(load_scenario("paper"), domain=DOMAIN)
    session._monitor = monitor
    clock.now_s += 1000.0
    try:
        with pytest.raises(GraphError, match=r"^nodes world, gnss have been silent for"):
            session._check(3)
    finally:
        session._failed, session._monitor = False, None
        session.close()
