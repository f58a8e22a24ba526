"""The storyboard's state machine: priorities, executions, triggers of acts, and the stop, as tables of transitions."""

from pathlib import Path

import pytest
from storyboard_stage import (
    Show,
    after,
    car,
    dynamics,
    event,
    lane,
    placed,
    speed,
    story,
    storyboard,
    straight,
    trigger,
)

from simbev_ros.scene.storyboard import model
from simbev_ros.scene.storyboard.model import Element

SLOW = ("linear", "time", 4.0)
SLOWER = model.SpeedAction(
    dynamics=dynamics("linear", "time", 1.0),
    target=model.RelativeTargetSpeed(entity_ref="ego", value=-1.0, speed_target_value_type="delta", continuous=False),
)
"""It is 1 m/s slower after 1 s."""


def show(folder: Path, *stories: Element, stop: Element | None = None, values: dict[str, str] | None = None) -> Show:
    return Show(straight(folder), [car("ego")], storyboard(placed("ego", lane(0.0), 10.0), *stories, stop=stop), values)


PRIORITIES = {
    # What happens to an event of 4 s from 1 s on, and to the one that is triggered at 2 s.
    "override": ([("start", 1.0), ("stop", 2.0)], [("start", 2.0), ("end", 3.0)]),
    "skip": ([("start", 1.0), ("end", 5.0)], [("skip", 2.0)]),
    "parallel": ([("start", 1.0), ("end", 5.0)], [("start", 2.0), ("end", 3.0)]),
}


@pytest.mark.parametrize("priority", PRIORITIES)
def test_priorities(tmp_path: Path, priority: str) -> None:
    shift = model.LaneOffsetAction(
        continuous=False,
        dynamics=model.LaneOffsetActionDynamics(dynamics_shape="cubic", max_lateral_acc_mps2=6.0),
        target=model.AbsoluteTargetLaneOffset(value_m=1.0),
    )  # lasts 1 s
    running = show(
        tmp_path,
        story(
            ["ego"],
            event("first", after(1.0), speed(5.0, *SLOW)),
            event("second", after(2.0), shift, priority=priority),
        ),
    )
    running.run_to(8.0)
    first, second = PRIORITIES[priority]
    for name, expected in (("first", first), ("second", second)):
        found = [(change, pytest.approx(time_s, abs=1e-6)) for time_s, change, part in running.log if part == name]
        assert found == expected, running.log


def test_events_of_other_maneuvers_are_left_alone(tmp_path: Path) -> None:
    other = story(["ego"], event("second", after(2.0), model.AssignControllerAction()))
    running = show(tmp_path, story(["ego"], event("first", after(1.0), speed(5.0, *SLOW))), other)
    running.run_to(8.0)
    assert running.times("end", "first") == [5.0]


@pytest.mark.parametrize("times", [1, 3])
def test_an_event_starts_again_up_to_its_maximum(tmp_path: Path, times: int) -> None:
    again = trigger(model.SimulationTimeCondition(value_s=1.0, rule="greaterOrEqual"))
    running = show(tmp_path, story(["ego"], event("e", again, SLOWER, times=times)))
    running.run_to(6.0)
    assert running.times("start", "e") == pytest.approx([1.0, 2.0, 3.0][:times])
    assert running.times("end", "act") == [pytest.approx(1.0 + times)]


def test_a_maneuver_group_runs_again(tmp_path: Path) -> None:
    running = show(tmp_path, story(["ego"], event("e", after(1.0), SLOWER), times=2))
    running.run_to(6.0)
    assert running.times("start", "group") == [0.0, 2.0]
    assert running.times("start", "e") == [1.0, 2.0]
    assert running.times("end", "act") == [3.0]


def test_an_act_waits_for_its_start_and_obeys_its_stop(tmp_path: Path) -> None:
    running = show(
        tmp_path,
        story(["ego"], event("e", after(0.0), speed(0.0, "linear", "time", 10.0)), start=after(1.0), stop=after(3.0)),
    )
    running.run_to(5.0)
    assert running.times("start", "act") == running.times("start", "e") == [1.0]
    assert running.times("stop", "act") == running.times("stop", "e") == [3.0]
    assert running["ego"].speed_mps == pytest.approx(8.0)  # from where it was stopped on, the speed is kept


def test_endings_are_seen_at_once_and_beginnings_at_the_next_tick(tmp_path: Path) -> None:
    def of(state: str) -> Element:
        return trigger(
            model.StoryboardElementStateCondition(
                storyboard_element_type="event", storyboard_element_ref="maneuver::e", state=state
            )
        )

    names = {
        "startTransition": 1.05,
        "endTransition": 2.0,
        "completeState": 2.0,
        "runningState": 1.05,
        "standbyState": 0.0,
    }
    probes = [event(f"on-{state}", of(state), model.AssignControllerAction(), priority="parallel") for state in names]
    running = show(tmp_path, story(["ego"], event("e", after(1.0), speed(5.0, "linear", "time", 1.0)), *probes))
    running.run_to(3.0)
    assert {state: running.times("start", f"on-{state}") for state in names} == {
        state: [pytest.approx(time_s)] for state, time_s in names.items()
    }


def test_skipped_and_stopped_events_are_seen(tmp_path: Path) -> None:
    def of(name: str, state: str) -> Element:
        return trigger(
            model.StoryboardElementStateCondition(
                storyboard_element_type="event", storyboard_element_ref=name, state=state
            )
        )

    skipped = event("skipped", after(1.0), speed(1.0), priority="skip")
    over = event("over", after(2.0), speed(1.0))
    probes = [
        event("saw-skip", of("skipped", "skipTransition"), model.AssignControllerAction(), priority="parallel"),
        event("saw-stop", of("long", "stopTransition"), model.AssignControllerAction(), priority="parallel"),
    ]
    running = show(tmp_path, story(["ego"], event("long", after(0.0), speed(5.0, *SLOW)), skipped, over, *probes))
    running.run_to(3.0)
    assert running.times("start", "saw-skip") == [pytest.approx(1.05)]
    assert running.times("start", "saw-stop") == [pytest.approx(2.05)]


def test_the_stop_trigger_stops_all(tmp_path: Path) -> None:
    running = show(tmp_path, story(["ego"], event("e", after(0.0), speed(5.0, *SLOW))), stop=after(2.0))
    running.run_to(1.95)
    assert not running.storyboard.has_stopped
    running.run_to(2.0)
    assert running.storyboard.has_stopped
    assert running.times("stop", "story") == running.times("stop", "e") == [2.0]


def test_a_story_without_events_is_complete(tmp_path: Path) -> None:
    group = model.ManeuverGroup(
        name="group", maximum_execution_count=1, actors=model.Actors(select_triggering_entities=False), maneuvers=()
    )
    empty = model.Story(name="story", acts=(model.Act(name="act", maneuver_groups=(group,)),))
    running = show(tmp_path, empty)
    running.run_to(0.1)
    assert running.times("end", "act") == [0.05]
