"""A command acts a fixed number of ticks after its stamp, whenever it arrives."""

import pytest

from simbev_ros.ros.nodes.command_queue import CommandQueue
from simbev_ros.simulation.world.driving.commands import AckermannCommand

COMMANDS = [AckermannCommand(0.0, float(tick)) for tick in range(10)]


@pytest.mark.parametrize("ahead", [0, 1, 2])
def test_a_command_acts_the_window_after_its_stamp_however_early_it_came(ahead: int) -> None:
    queue, taken, sent = CommandQueue(3), {}, 0
    for tick in range(12):
        while sent <= min(tick - 3 + ahead, 9):
            queue.add(sent, COMMANDS[sent], tick)
            sent += 1
        taken[tick] = list(queue.take(tick))
    assert taken == {tick: [COMMANDS[tick - 3]] if tick >= 3 else [] for tick in range(12)}


def test_in_a_live_graph_a_command_acts_at_the_next_tick() -> None:
    queue = CommandQueue(0)
    queue.add(5, COMMANDS[5], 6)
    assert list(queue.take(6)) == [COMMANDS[5]]
    assert list(queue.take(7)) == []


def test_a_command_that_is_not_newer_is_refused() -> None:
    queue = CommandQueue(3)
    queue.add(4, COMMANDS[4], 5)
    for tick in (4, 2):
        with pytest.raises(ValueError, match=f"a command for tick {tick} came after one for tick 4; it is not used"):
            queue.add(tick, COMMANDS[0], 6)
    assert list(queue.take(7)) == [COMMANDS[4]]


def test_commands_of_the_lead_in_do_not_count() -> None:
    queue = CommandQueue(1)
    queue.add(-1, COMMANDS[0], 0)
    assert list(queue.take(5)) == []


def test_in_a_live_graph_a_command_that_is_too_old_is_refused() -> None:
    queue = CommandQueue(0, max_age_ticks=10)
    queue.add(5, COMMANDS[5], 15)
    with pytest.raises(ValueError, match="a command for tick 6 came before tick 17, too late; it is not used"):
        queue.add(6, COMMANDS[6], 17)
    assert list(queue.take(17)) == [COMMANDS[5]]
