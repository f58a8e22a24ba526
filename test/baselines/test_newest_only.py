"""A live stack works on the newest frame; those that it was too slow for are dropped."""

import threading

import pytest
from waiting import PATIENCE_S

from simbev_ros.baselines.node.newest import NewestOnly


def test_items_that_a_newer_one_replaces_are_dropped() -> None:
    done: list[int] = []
    started, may_go_on, finished = threading.Event(), threading.Event(), threading.Event()

    def work(item: int) -> None:
        started.set()
        may_go_on.wait(PATIENCE_S)
        done.append(item)
        if item == 3:
            finished.set()

    newest = NewestOnly(work)
    newest.put(1)
    assert started.wait(PATIENCE_S)
    newest.put(2)
    newest.put(3)
    may_go_on.set()
    assert finished.wait(PATIENCE_S)
    newest.close()
    assert done == [1, 3]


def test_a_failure_reaches_the_thread_that_hands_over_items() -> None:
    def work(item: int) -> None:
        raise ZeroDivisionError(f"item {item}")

    newest = NewestOnly(work)
    newest.put(1)
    newest._thread.join(PATIENCE_S)
    with pytest.raises(ZeroDivisionError, match="item 1"):
        newest.put(2)
    newest.close()


def test_close_drops_what_waits() -> None:
    newest = NewestOnly(lambda item: None)
    newest.close()
    assert not newest._thread.is_alive()
