"""A node that computes while a scene loads is not taken for one that is stuck."""

from simbev_ros.ros.graph.loading_watch import LoadingWatch

TIMEOUT_S = 20.0


def test_processes_that_use_a_core_are_named_and_those_that_wait_are_not() -> None:
    watch = LoadingWatch(100.0, TIMEOUT_S)
    assert watch.computing(103.0, {"world": 1.0, "gnss+imu": 1.0, "camera": 1.0}) == [], "there is nothing to compare"
    assert watch.computing(113.0, {"world": 1.1, "gnss+imu": 2.0, "camera": 1.6}) == ["gnss", "imu", "camera"]
    assert watch.computing(123.0, {"world": 2.1, "gnss+imu": 2.0, "camera": 1.6}) == ["world"]


def test_between_two_looks_there_is_some_time() -> None:
    watch = LoadingWatch(0.0, TIMEOUT_S)
    watch.computing(3.0, {"world": 1.0})
    assert watch.computing(3.1, {"world": 1.1}) == []
    assert watch.computing(6.0, {"world": 2.0}) == ["world"], "what was spent since the last comparison counts"


def test_an_endless_loop_counts_only_for_a_while() -> None:
    watch = LoadingWatch(0.0, TIMEOUT_S)
    named = [bool(watch.computing(float(second), {"world": float(second)})) for second in range(3, 300, 3)]
    assert named == [False, *(second < 10 * TIMEOUT_S for second in range(6, 300, 3))]
