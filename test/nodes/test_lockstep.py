from simbev_ros.config.load import load_scenario
from simbev_ros.maps.build import load_network
from simbev_ros.nodes.lockstep import Lockstep
from simbev_ros.nodes.reports import Report
from simbev_ros.scene.drawing.draw_scene import draw_scene, planned_scenes
from simbev_ros.scene.spec import SceneSpec


def _spec() -> SceneSpec:
    scenario = load_scenario("demo")
    planned = next(planned_scenes(scenario))
    return draw_scene(scenario, planned, load_network(planned.map))


SPEC = _spec()


def lockstep(window_ticks: int) -> Lockstep:
    result = Lockstep(["camera", "lidar"], window_ticks)
    result.start_scene(SPEC)
    return result


def report(lock: Lockstep, name: str, tick: int) -> None:
    lock.record_report(Report(name, SPEC.name, SPEC.stamp_ns(tick)))


def test_no_tick_starts_before_all_participants_have_loaded_the_scene() -> None:
    lock = lockstep(3)
    report(lock, "camera", SPEC.loaded_tick)
    assert not lock.may_start(-SPEC.lead_in_ticks)
    report(lock, "lidar", SPEC.loaded_tick)
    assert lock.may_start(-SPEC.lead_in_ticks)


def test_the_world_is_at_most_the_window_ahead_of_the_slowest_participant() -> None:
    lock = lockstep(3)
    report(lock, "camera", 20)
    report(lock, "lidar", 10)
    assert lock.may_start(13)
    assert not lock.may_start(14)
    assert lock.laggards() == ["lidar"]
    assert lock.finished_by_all() == 10


def test_reports_of_other_scenes_and_unknown_nodes_are_ignored() -> None:
    lock = lockstep(1)
    lock.record_report(Report("camera", "Elsewhere-0009", SPEC.stamp_ns(5)))
    lock.record_report(Report("stranger", SPEC.name, SPEC.stamp_ns(5)))
    assert lock.finished_by_all() is None


def test_a_late_report_of_an_earlier_tick_is_ignored() -> None:
    lock = lockstep(1)
    for tick in (4, 2):
        report(lock, "camera", tick)
        report(lock, "lidar", 9)
    assert lock.finished_by_all() == 4


def test_a_report_before_the_scene_does_not_count_as_loaded() -> None:
    lock = lockstep(3)
    report(lock, "camera", SPEC.loaded_tick)
    assert not lock.record_report(Report("lidar", SPEC.name, 0))
    assert lock.finished_by_all() is None
    assert lock.laggards() == ["lidar"]
    first_ns = SPEC.stamp_ns(SPEC.loaded_tick)
    assert lock.describe_early_reports() == [
        f"lidar has reported stamp 0 ns, which precedes the scene; its first should be {first_ns} ns"
    ]
    report(lock, "lidar", SPEC.loaded_tick)
    assert lock.may_start(-SPEC.lead_in_ticks)
    assert lock.describe_early_reports() == []


def test_the_earliest_report_that_counts_lets_the_scene_start() -> None:
    lock = lockstep(3)
    for name in ("camera", "lidar"):
        report(lock, name, -SPEC.lead_in_ticks - 3)
    assert lock.may_start(-SPEC.lead_in_ticks)
    report(lock, "camera", -SPEC.lead_in_ticks - 4)
    assert lock.describe_early_reports() == []


def test_reports_of_participants_count_also_when_a_scene_starts_again() -> None:
    lock = lockstep(1)
    assert all(lock.record_report(Report("camera", SPEC.name, SPEC.stamp_ns(tick))) for tick in (0, 1, 0))
    assert not lock.record_report(Report("stranger", SPEC.name, SPEC.stamp_ns(1)))


def test_a_tick_that_the_scene_does_not_have_is_ignored() -> None:
    lock = lockstep(1)
    report(lock, "lidar", SPEC.ticks)  # files are written after the last tick
    assert not lock.record_report(Report("camera", SPEC.name, SPEC.stamp_ns(SPEC.ticks + 1)))
    assert lock.finished_by_all() is None
