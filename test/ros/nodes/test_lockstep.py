import pytest

from simbev_ros.config.load import load_scenario
from simbev_ros.maps.build import load_network
from simbev_ros.ros.nodes.lockstep import LockstepWindow
from simbev_ros.ros.nodes.reports import Report
from simbev_ros.scene.drawing.draw_scene import draw_scene, planned_scenes
from simbev_ros.schema.scene.spec import SceneSpec


def _spec() -> SceneSpec:
    scenario = load_scenario("demo")
    planned = next(planned_scenes(scenario))
    return draw_scene(scenario, planned, load_network(planned.map))


SPEC = _spec()


def lockstep(window_ticks: int) -> LockstepWindow:
    result = LockstepWindow(["camera", "lidar"], window_ticks)
    result.start_scene(SPEC)
    return result


def report(lock: LockstepWindow, name: str, tick: int) -> None:
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


def test_a_tick_long_before_the_scene_does_not_count_as_loaded() -> None:
    lock = lockstep(3)
    report(lock, "camera", SPEC.loaded_tick)
    assert not lock.record_report(Report("lidar", SPEC.name, 0))
    assert lock.finished_by_all() is None
    report(lock, "lidar", -SPEC.lead_in_ticks - 3)
    assert lock.may_start(-SPEC.lead_in_ticks)


def test_reports_of_participants_count_also_when_a_scene_starts_again() -> None:
    lock = lockstep(1)
    assert all(lock.record_report(Report("camera", SPEC.name, SPEC.stamp_ns(tick))) for tick in (0, 1, 0))
    assert not lock.record_report(Report("stranger", SPEC.name, SPEC.stamp_ns(1)))


def test_a_tick_that_the_scene_does_not_have_is_ignored() -> None:
    lock = lockstep(1)
    report(lock, "lidar", SPEC.ticks)  # files are written after the last tick
    assert not lock.record_report(Report("camera", SPEC.name, SPEC.stamp_ns(SPEC.ticks + 1)))
    assert lock.finished_by_all() is None


STACK = "my_stack"
NOON_NS = 1_795_600_000 * 10**9
"""A stamp from the wall clock."""


def outside_lockstep() -> LockstepWindow:
    result = LockstepWindow([STACK], 3, outside=[STACK])
    result.start_scene(SPEC)
    return result


def stack_reports(lock: LockstepWindow, stamp_ns: int, scene: str = SPEC.name) -> bool:
    return lock.record_report(Report(STACK, scene, stamp_ns))


@pytest.mark.parametrize("scene", [SPEC.name, ""], ids=["with scene", "without scene"])
@pytest.mark.parametrize(
    "stamp_ns", [0, SPEC.stamp_ns(-1), SPEC.stamp_ns(0), SPEC.stamp_ns(7), SPEC.stamp_ns(SPEC.ticks - 1)]
)
def test_the_first_report_from_outside_means_loaded_and_no_more_whatever_its_stamp(stamp_ns: int, scene: str) -> None:
    lock = outside_lockstep()
    assert stack_reports(lock, stamp_ns, scene)
    assert lock.may_start(2) and not lock.may_start(3)


def test_also_a_stamp_from_the_wall_clock_means_loaded_but_later_ones_are_no_finished_ticks() -> None:
    lock = outside_lockstep()
    assert stack_reports(lock, NOON_NS)
    assert not stack_reports(lock, NOON_NS + 10**9)
    assert lock.finished_by_all() == -1


def test_who_reports_the_tick_before_the_lead_in_is_waited_for_in_the_lead_in() -> None:
    lock = LockstepWindow([STACK], 1, outside=[STACK])
    lock.start_scene(SPEC)
    assert stack_reports(lock, SPEC.stamp_ns(SPEC.loaded_tick))
    assert lock.may_start(SPEC.loaded_tick + 1) and not lock.may_start(SPEC.loaded_tick + 2)


def test_repeated_first_reports_change_nothing_and_are_no_progress() -> None:
    lock = outside_lockstep()
    assert [stack_reports(lock, SPEC.stamp_ns(5)) for _ in range(3)] == [True, False, False]
    assert stack_reports(lock, SPEC.stamp_ns(0))
    assert lock.finished_by_all() == 0
    assert not stack_reports(lock, 0) and not stack_reports(lock, SPEC.stamp_ns(0))
    assert lock.finished_by_all() == 0


def test_what_an_earlier_graph_left_over_of_the_same_scene_does_not_finish_it() -> None:
    lock = outside_lockstep()
    last_ns = SPEC.stamp_ns(SPEC.ticks - 1)
    assert stack_reports(lock, last_ns)  # latched since the last run
    assert not stack_reports(lock, 0)
    for tick in range(SPEC.ticks - 1):
        assert stack_reports(lock, SPEC.stamp_ns(tick))
        assert lock.finished_by_all() == tick
    assert stack_reports(lock, last_ns)
    assert lock.finished_by_all() == SPEC.ticks - 1


def test_a_first_report_of_a_published_tick_counts_because_earlier_ones_have_been_missed() -> None:
    for published_tick, counted in ((7, 7), (8, 7), (6, -1)):
        lock = outside_lockstep()
        lock.record_report(Report(STACK, SPEC.name, SPEC.stamp_ns(7)), published_tick)
        assert lock.finished_by_all() == counted


def test_reports_from_outside_in_advance_reach_at_most_the_last_tick() -> None:
    lock = outside_lockstep()
    assert stack_reports(lock, 0)
    assert stack_reports(lock, SPEC.stamp_ns(SPEC.ticks + 9))
    assert lock.finished_by_all() == SPEC.ticks - 1


def test_a_report_without_a_scene_belongs_to_that_of_its_stamp() -> None:
    lock = outside_lockstep()
    following = SPEC.model_copy(update={"number": SPEC.number + 1})
    assert not stack_reports(lock, following.stamp_ns(3), scene="")
    assert not stack_reports(lock, following.stamp_ns(3), scene=following.name)
    assert lock.laggards() == [STACK]


def test_a_new_scene_waits_for_a_new_first_report_from_outside() -> None:
    lock = outside_lockstep()
    stack_reports(lock, 0)
    lock.start_scene(SPEC)
    assert not lock.all_loaded


def test_a_released_participant_is_not_waited_for_in_this_scene() -> None:
    lock = lockstep(3)
    report(lock, "camera", 20)
    lock.release("lidar")
    assert lock.may_start(23)
    assert not lock.may_start(24)
    assert lock.laggards() == ["camera"]
    lock.start_scene(SPEC)
    assert not lock.all_loaded
