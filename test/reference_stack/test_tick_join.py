"""Ticks are completed with the right messages in every order of arrival."""

from itertools import combinations

import pytest

from simbev_ros.reference_stack.tick_join import TickJoin

Complete = list[tuple[int, str, str | None]]


def _every_second(stamp_ns: int) -> list[str]:
    return ["c"] if stamp_ns % 20 == 0 else []


def _arrive(join: TickJoin[str, str], *messages: str) -> Complete:
    """Add messages such as ``c20`` (cloud) and ``o20`` (odometry); return all ticks that they complete."""
    complete: Complete = []
    for message in messages:
        stamp_ns = int(message[1:])
        if message[0] == "c":
            join.add_input("c", stamp_ns, message)
        else:
            join.add_odometry(stamp_ns, message)
        complete += [(at, odometry, found.get("c")) for at, odometry, found in join.release_complete(_every_second)]
    return complete


def _fast_and_slow(stamp_ns: int) -> list[str]:
    return [name for name, period in (("fast", 10), ("slow", 20)) if stamp_ns % period == 0]


def test_a_tick_waits_for_all_inputs_that_are_due() -> None:
    join: TickJoin[str, str] = TickJoin()
    join.add_odometry(20, "o20")
    join.add_odometry(30, "o30")
    join.add_input("fast", 30, "f30")
    join.add_input("fast", 20, "f20")
    assert [*join.release_complete(_fast_and_slow)] == []
    join.add_input("slow", 20, "s20")
    assert [*join.release_complete(_fast_and_slow)] == [
        (20, "o20", {"fast": "f20", "slow": "s20"}),
        (30, "o30", {"fast": "f30"}),
    ]


def test_a_tick_that_lost_one_of_its_inputs_is_released_with_the_other_ones() -> None:
    join: TickJoin[str, str] = TickJoin()
    for name, stamp_ns in (("fast", 20), ("fast", 40), ("slow", 40)):
        join.add_input(name, stamp_ns, f"{name}{stamp_ns}")
    join.add_odometry(20, "o20")
    assert [*join.release_complete(_fast_and_slow)] == [(20, "o20", {"fast": "fast20"})]


@pytest.mark.parametrize("clouds_at", [*combinations(range(5), 2)])
def test_ticks_are_released_in_order_with_their_clouds_whichever_topic_is_ahead(clouds_at: tuple[int, int]) -> None:
    clouds, odometry = iter(["c20", "c40"]), iter(["o20", "o30", "o40"])
    arrivals = [next(clouds if position in clouds_at else odometry) for position in range(5)]
    assert _arrive(TickJoin(), *arrivals) == [(20, "o20", "c20"), (30, "o30", None), (40, "o40", "c40")]


def test_tick_without_a_cloud_waits_for_earlier_ticks() -> None:
    join: TickJoin[str, str] = TickJoin()
    assert _arrive(join, "o20", "o30") == []
    assert _arrive(join, "c20") == [(20, "o20", "c20"), (30, "o30", None)]


def test_cloud_counts_as_lost_when_a_later_one_has_arrived() -> None:
    assert _arrive(TickJoin(), "o20", "o30", "o40", "c40") == [(20, "o20", None), (30, "o30", None), (40, "o40", "c40")]


def test_cloud_without_odometry_is_dropped() -> None:
    join: TickJoin[str, str] = TickJoin()
    assert _arrive(join, "c20", "o30", "o40", "c40") == [(30, "o30", None), (40, "o40", "c40")]


def test_silent_lidar_does_not_fill_the_memory() -> None:
    join: TickJoin[str, str] = TickJoin()
    complete = _arrive(join, *(f"o{20 * tick}" for tick in range(150)))
    assert [stamp_ns for stamp_ns, *_ in complete] == [20 * tick for tick in range(50)]


def test_clear_forgets_all_messages() -> None:
    join: TickJoin[str, str] = TickJoin()
    _arrive(join, "o20", "c40")
    join.clear()
    assert _arrive(join, "o40") == []
