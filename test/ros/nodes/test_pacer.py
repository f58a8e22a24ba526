"""Ticks start at once, by the wall clock where a real-time factor limits them, and on request while paused."""

import numpy as np
import pytest

from simbev_ros.ros.nodes.pacer import Pacer

TICK_NS = 50_000_000


def test_while_paused_one_tick_starts_per_requested_step() -> None:
    pacer = Pacer(0.0)
    assert pacer.take_due(TICK_NS)
    pacer.pause(True)
    pacer.steps += 2
    assert [pacer.take_due(TICK_NS) for _ in range(3)] == [True, True, False]


def test_unused_steps_are_dropped_on_resume() -> None:
    pacer = Pacer(0.0)
    pacer.pause(True)
    pacer.steps += 2
    pacer.pause(False)
    assert pacer.take_due(TICK_NS)
    pacer.pause(True)
    assert not pacer.take_due(TICK_NS)


def test_live_ticks_do_not_start_before_their_time() -> None:
    pacer = Pacer(1.0)
    pacer.start()
    assert [pacer.take_due(3600 * 10**9) for _ in range(3)] == [True, False, False]


def test_a_factor_stretches_the_time_between_ticks(monkeypatch: pytest.MonkeyPatch) -> None:
    now_s = 100.0
    monkeypatch.setattr("simbev_ros.ros.nodes.pacer.time.monotonic", lambda: now_s)
    pacer = Pacer(0.5)
    started_s = []
    for now_s in np.arange(100.0, 101.0, 0.01).tolist():
        if pacer.take_due(TICK_NS):
            started_s.append(now_s)
    assert np.diff(started_s) == pytest.approx(0.1, abs=0.011)
    assert len(started_s) == 10
