"""Ticks are completed with the right messages in every order of arrival."""

from itertools import combinations

import pytest

from simbev_ros.reference_stack.tick_join import TickJoin

Complete = list[tuple[int, str, str | None]]


def _every_second(stamp_ns: int) -> bool:
    return stamp_ns % 20 == 0


def _arrive(join: TickJoin[str, str], *messages: str) -> Complete:
    """Add messages such as ``c20`` (cloud) and ``o20`` (odometry); return all ticks that they complete."""
    complete: Complete = []
    for message in messages:
        add = join.add_cloud if message[0] == "c" else join.add_odometry
        add(int(message[1:]), message)
        complete += join.release_complete(_every_second)
    return complete


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
