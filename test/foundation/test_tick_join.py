"""Ticks leave a join once, with the right messages, in whatever order messages arrive; late messages are dropped."""

import sys
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from simbev_ros.foundation import tick_join
from simbev_ros.foundation.tick_join import TickJoin, all_of, at_periods

PERIODS = {"lidar": 1, "radar": 2, "cam": 4}
Complete = list[tuple[int, str, str | None]]
Join = TickJoin[str, str]


def lidar_join(*, patience_ticks: int | None = None) -> Join:
    """A join whose ticks wait for a lidar's message."""
    return TickJoin(all_of(at_periods({"lidar": 1}), patience_ticks=patience_ticks))


def stack_join() -> Join:
    """The join of a stack that waits for a cloud at every second of its stamps, which may get lost."""
    due = all_of(lambda stamp: ["c"] if stamp % 20 == 0 else [], patience_ticks=1000, in_order=True)
    return TickJoin(due, capacity=200)


def arrive(join: Join, *messages: str) -> Complete:
    """Add messages such as ``c20`` (cloud) and ``o20`` (opens the tick); return all ticks that they complete."""
    complete: Complete = []
    for message in messages:
        stamp = int(message[1:])
        if message[0] == "c":
            join.add("c", stamp, message)
        else:
            join.open(stamp, message)
        complete += [(at, item, found.get("c")) for at, item, found in join.release()]
    return complete


@pytest.mark.parametrize("seed", range(20))
def test_every_tick_leaves_once_in_order_with_all_due_messages(seed: int) -> None:
    rng = np.random.default_rng(seed)
    join: Join = TickJoin(all_of(at_periods(PERIODS)))
    streams = [
        [("", tick) for tick in range(12)],
        *([(name, tick) for tick in range(0, 12, period)] for name, period in PERIODS.items()),
    ]
    released = []
    while any(streams):
        sender, tick = streams[rng.choice([k for k, stream in enumerate(streams) if stream])].pop(0)
        if sender:
            assert join.add(sender, tick, f"{sender} {tick}")
        else:
            join.open(tick, f"tick {tick}")
        released += list(join.release())
    due = {tick: {name: f"{name} {tick}" for name, p in PERIODS.items() if tick % p == 0} for tick in range(12)}
    assert released == [(tick, f"tick {tick}", due[tick]) for tick in range(12)] and join.late == 0


def test_with_patience_a_tick_leaves_without_lost_messages_and_late_ones_are_dropped() -> None:
    join = lidar_join(patience_ticks=3)
    for tick in range(4):
        join.open(tick, "")
        if tick != 0:
            join.add("lidar", tick, f"lidar {tick}")
        if tick < 3:
            assert list(join.release()) == []
    assert list(join.release()) == [(0, "", {}), *((tick, "", {"lidar": f"lidar {tick}"}) for tick in (1, 2, 3))]
    assert not join.add("lidar", 0, "late") and join.late == 1
    join.open(4, "")
    join.add("lidar", 4, "lidar 4")
    assert list(join.release()) == [(4, "", {"lidar": "lidar 4"})]


def test_messages_of_ticks_that_were_never_opened_are_removed() -> None:
    join = lidar_join(patience_ticks=3)
    for tick in range(9):
        join.add("lidar", tick, f"lidar {tick}")
    for tick in (2, 8):
        join.open(tick, "")
    assert list(join.release()) == [(2, "", {"lidar": "lidar 2"}), (8, "", {"lidar": "lidar 8"})]
    assert not any(join.has("lidar", tick) for tick in range(9))


def test_a_tick_does_not_wait_for_a_stream_that_is_not_awaited_any_more() -> None:
    periods = {"lidar": 1, "radar": 1}
    join: Join = TickJoin(all_of(at_periods(periods)))
    join.open(0, "")
    join.add("lidar", 0, "cloud")
    assert list(join.release()) == []
    del periods["radar"]
    assert list(join.release()) == [(0, "", {"lidar": "cloud"})]


def test_without_streams_no_tick_waits() -> None:
    join: Join = TickJoin(all_of(at_periods({})))
    join.open(7, "")
    assert list(join.release()) == [(7, "", {})]


def test_what_waits_is_bounded_although_strangers_send_ticks_that_never_come() -> None:
    join = lidar_join()
    for tick in range(0, 10**6, 100):
        join.add("lidar", tick, "forged")
    assert sum(join.has("lidar", tick) for tick in range(0, 10**6, 100)) == 64
    join.open(0, "")
    assert list(join.release()) == [(0, "", {"lidar": "forged"})]


def newest_join() -> Join:
    return TickJoin(all_of(lambda _: ["signals", "weather"]), newest=True)


def test_only_the_newest_complete_tick_leaves_and_earlier_ones_never_do() -> None:
    join = newest_join()
    for tick in (1, 2, 3):
        join.open(tick, f"actors {tick}")
        join.add("signals", tick, "")
    for tick in (2, 1):
        join.add("weather", tick, "")
    assert [(tick, item) for tick, item, _ in join.release()] == [(2, "actors 2")]
    join.open(1, "again")
    assert join.late == 1 and not join.add("weather", 1, "") and not list(join.release())
    join.add("weather", 3, "")
    assert [tick for tick, *_ in join.release()] == [3]


def test_ticks_far_ahead_of_strangers_do_not_keep_the_newest_one_from_leaving() -> None:
    join = newest_join()
    for tick in range(10**6, 10**6 + 200):
        join.open(tick, "forged")
        join.add("signals", tick, "forged")
    for tick in (0, 1):
        join.open(tick, "")
        join.add("signals", tick, "")
        join.add("weather", tick, "")
        assert [tick for tick, *_ in join.release()] == [tick]


@pytest.mark.parametrize("clouds_at", [*combinations(range(5), 2)])
def test_stamps_leave_in_order_with_their_clouds_whichever_topic_is_ahead(clouds_at: tuple[int, int]) -> None:
    clouds, odometry = iter(["c20", "c40"]), iter(["o20", "o30", "o40"])
    arrivals = [next(clouds if position in clouds_at else odometry) for position in range(5)]
    assert arrive(stack_join(), *arrivals) == [(20, "o20", "c20"), (30, "o30", None), (40, "o40", "c40")]


def test_a_message_counts_as_lost_when_a_later_one_of_its_stream_has_come() -> None:
    ends = [(20, "o20", None), (30, "o30", None), (40, "o40", "c40")]
    assert arrive(stack_join(), "o20", "o30", "o40", "c40") == ends


def test_a_tick_that_lost_one_of_its_messages_leaves_with_the_others() -> None:
    join: Join = TickJoin(all_of(lambda _: ["fast", "slow"], in_order=True))
    for name, stamp in (("fast", 20), ("fast", 40), ("slow", 40)):
        join.add(name, stamp, f"{name}{stamp}")
    join.open(20, "o20")
    assert list(join.release()) == [(20, "o20", {"fast": "fast20"})]


def test_a_message_without_an_open_tick_is_dropped() -> None:
    assert arrive(stack_join(), "c20", "o30", "o40", "c40") == [(30, "o30", None), (40, "o40", "c40")]


def test_a_silent_stream_does_not_fill_the_memory() -> None:
    complete = arrive(stack_join(), *(f"o{20 * tick}" for tick in range(150)))
    assert [stamp for stamp, *_ in complete] == [20 * tick for tick in range(100)]


def test_a_slow_stream_contributes_its_latest_sample_once_and_no_others_are_kept() -> None:
    join: Join = TickJoin(
        all_of(lambda _: []), newest=True, sample_of=lambda name, tick: tick - tick % (4 if name == "image" else 1)
    )
    for tick in range(7):
        join.add("odom", tick, f"odom {tick}")
        if tick % 4 == 0:
            join.add("image", tick, f"image {tick}")
    assert [tick for tick in range(7) if join.has("odom", tick)] == [6]
    join.open(6, "")
    assert list(join.release()) == [(6, "", {"odom": "odom 6", "image": "image 4"})]
    join.add("odom", 7, "odom 7")
    join.open(7, "")
    assert list(join.release()) == [(7, "", {"odom": "odom 7"})]


def test_the_module_needs_nothing_but_python() -> None:
    lines = Path(tick_join.__file__).read_text().splitlines()
    imported = {line.split()[1].partition(".")[0] for line in lines if line.startswith(("import ", "from "))}
    assert imported <= sys.stdlib_module_names
