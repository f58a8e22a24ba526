"""Ticks start at once in lockstep, by the wall clock in live mode, and on request while paused."""

from simbev_ros.ros.nodes.pacer import Pacer

TICK_NS = 50_000_000


def test_while_paused_one_tick_starts_per_requested_step() -> None:
    pacer = Pacer(live=False)
    assert pacer.take_due(TICK_NS)
    pacer.pause(True)
    pacer.steps += 2
    assert [pacer.take_due(TICK_NS) for _ in range(3)] == [True, True, False]


def test_unused_steps_are_dropped_on_resume() -> None:
    pacer = Pacer(live=False)
    pacer.pause(True)
    pacer.steps += 2
    pacer.pause(False)
    assert pacer.take_due(TICK_NS)
    pacer.pause(True)
    assert not pacer.take_due(TICK_NS)


def test_live_ticks_do_not_start_before_their_time() -> None:
    pacer = Pacer(live=True)
    pacer.start()
    assert [pacer.take_due(3600 * 10**9) for _ in range(3)] == [True, False, False]
