"""A graph that falls behind the wall clock says so once a scene, and names the node that binds."""

from simbev_ros.ros.graph.pace_watch import PaceWatch


def feed(watch: PaceWatch, seconds: int, **nodes: tuple[int, int, float]) -> list[str]:
    """What is said while nodes report ticks, late ticks and milliseconds per tick, once a second."""
    said = []
    for _ in range(seconds):
        for name, (ticks, late, busy_ms) in nodes.items():
            watch.add(name, {"ticks": f"{ticks}", "late": f"{late}", "window_s": "1", "busy_ms": f"{busy_ms}"})
        if (words := watch.news()) is not None:
            said.append(words)
    return said


def started(watch: PaceWatch) -> PaceWatch:
    watch.start_scene(20.0)
    assert feed(watch, 2, world=(3, 0, 2.0), camera=(1, 2, 80.0)) == []  # while it loads
    return watch


def test_a_live_graph_names_the_node_that_loses_most_ticks() -> None:
    watch = started(PaceWatch(1.0, live=True))
    (said,) = feed(watch, 5, world=(20, 0, 2.0), camera=(12, 8, 81.0), lidar=(17, 3, 60.0))
    assert said.startswith("camera is the slowest node, with 81 ms a tick: 40% of its ticks are late")
    assert "--pace auto" in said


def test_a_slowed_clock_is_said_with_its_factor_and_the_busiest_node() -> None:
    watch = started(PaceWatch(1.0))
    (said,) = feed(watch, 5, world=(12, 0, 2.0), camera=(12, 0, 80.0), gnss=(12, 0, 0.3))
    assert said == "the clock runs at 0.60 times real time: camera is the slowest node, with 80 ms a tick"


def test_a_single_slow_second_is_none() -> None:
    watch = started(PaceWatch(1.0, live=True))
    assert feed(watch, 1, world=(20, 0, 2.0), camera=(12, 8, 81.0)) == []
    assert feed(watch, 5, world=(20, 0, 2.0), camera=(20, 0, 41.0)) == []
    assert feed(watch, 1, world=(20, 0, 2.0), camera=(12, 8, 81.0)) == []


def test_nothing_is_said_of_a_graph_that_runs_as_fast_as_it_can() -> None:
    assert feed(started(PaceWatch()), 5, world=(4, 0, 2.0), camera=(4, 0, 250.0)) == []


def test_a_new_scene_may_be_slow_again() -> None:
    watch = started(PaceWatch(1.0, live=True))
    slow = {"world": (20, 0, 2.0), "camera": (12, 8, 81.0)}
    assert len(feed(watch, 4, **slow)) == 1
    watch.start_scene(20.0)
    assert len(feed(watch, 6, **slow)) == 1
