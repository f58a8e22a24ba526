"""Ticks start at once in lockstep, and on request while paused."""

from simbev_ros.nodes.pacer import Pacer

TICK_NS = 50_000_000


def test_while_paused_as_many_ticks_start_as_steps_were_asked_for() -> None:
    pacer = Pacer(live=False)
    assert pacer.due(TICK_NS)
    pacer.pause(True)
    pacer.steps += 2
    assert [pacer.due(TICK_NS) for _ in range(3)] == [True, True, False]


def test_steps_that_were_not_taken_are_forgotten_when_the_world_goes_on() -> None:
    pacer = Pacer(live=False)
    pacer.pause(True)
    pacer.steps += 2
    pacer.pause(False)
    assert pacer.due(TICK_NS)
    pacer.pause(True)
    assert not pacer.due(TICK_NS)


def test_live_ticks_do_not_start_before_their_time() -> None:
    pacer = Pacer(live=True)
    pacer.start()
    assert [pacer.due(3600 * 10**9) for _ in range(3)] == [True, False, False]
