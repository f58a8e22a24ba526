"""Frames leave the join as soon as their data are complete, or cannot become so; the tests set the clock."""

from collections.abc import Iterable

import pytest

from simbev_ros.evaluation.live.answer_join import BOXES, LABELS, POSE, AnswerJoin, WaitLimits, pose_of
from simbev_ros.foundation.errors import InputError

LOCKSTEP, LIVE = WaitLimits(None, 10.0), WaitLimits(4, 2.0)


class SceneJoin:
    """A join with two topics of answers, and its clock."""

    def __init__(self, limits: WaitLimits, period: int = 1, topics: Iterable[str] = ("/boxes", "/bev")) -> None:
        self.join, self.now_s = AnswerJoin(lambda tick: tick % period == 0, limits), 0.0
        for topic in topics:
            self.join.add_topic(topic)
        self.pop_ticks()

    def truth(self, *ticks: int) -> "SceneJoin":
        for tick in ticks:
            for part in (POSE, BOXES, LABELS):
                self.join.add_truth(part, tick, f"{part} {tick}")
            self.join.add_input(tick, 100.0 + tick)
        return self

    def answer(self, tick: int, *topics: str, at_s: float = 0.0) -> "SceneJoin":
        for topic in topics or ("/boxes", "/bev"):
            self.join.add_answer(topic, tick, f"{topic} {tick}", at_s)
        return self

    def pop_ticks(self, after_s: float = 0.0) -> list[tuple[int, int]]:
        """Ticks of the frames that leave within a time, each with its number of answers; polls ten times a second."""
        found = []
        for _ in range(round(after_s / 0.1) + 1):
            found += [(frame.tick, len(frame.answers)) for frame in self.join.pop_ready_frames(self.now_s)]
            self.now_s += 0.1
        return found


def test_a_frame_leaves_once_truth_and_answers_are_there_in_any_order() -> None:
    scene = SceneJoin(LOCKSTEP).answer(0, at_s=100.5)
    assert scene.pop_ticks() == []
    scene.truth(0)
    [frame] = scene.join.pop_ready_frames(scene.now_s)
    assert frame.truth == {POSE: "pose 0", BOXES: "boxes 0", LABELS: "labels 0"}
    assert frame.answers == {"/boxes": "/boxes 0", "/bev": "/bev 0"}
    assert (frame.input_s, frame.answered_s, frame.is_complete) == (100.0, 100.5, True)


def test_frames_leave_in_tick_order() -> None:
    scene = SceneJoin(LOCKSTEP).truth(0, 1).answer(1, "/boxes")
    assert scene.pop_ticks() == []
    assert scene.answer(0, "/boxes", "/bev").answer(1, "/bev").pop_ticks() == [(0, 2), (1, 2)]
    assert scene.join.finished_tick == 1


def test_in_lockstep_an_answer_to_a_later_frame_means_that_earlier_ones_are_missed() -> None:
    scene = SceneJoin(LOCKSTEP).truth(0, 1).answer(1)
    assert scene.pop_ticks() == [(0, 0), (1, 2)]
    assert scene.join.counts.missed == 1


def test_a_later_answer_settles_only_its_own_topic() -> None:
    scene = SceneJoin(LOCKSTEP).truth(0, 1).answer(1, "/boxes").answer(0, "/boxes")
    assert scene.pop_ticks() == []
    assert scene.answer(1, "/bev").pop_ticks() == [(0, 1), (1, 2)]


def test_a_stack_that_has_finished_a_tick_has_one_more_second() -> None:
    scene = SceneJoin(LOCKSTEP).truth(0, 1)
    scene.join.mark_stack_finished(0)
    assert scene.pop_ticks(0.8) == []
    assert scene.pop_ticks(0.4) == [(0, 0)]


def test_any_arrival_restarts_the_second() -> None:
    scene = SceneJoin(LOCKSTEP).truth(0)
    scene.join.mark_stack_finished(0)
    assert scene.pop_ticks(0.8) == []
    assert scene.answer(0, "/boxes").pop_ticks(0.8) == []
    assert scene.pop_ticks(0.4) == [(0, 1)]


def test_waiting_is_limited() -> None:
    scene = SceneJoin(LOCKSTEP).truth(0)
    assert scene.pop_ticks(9.8) == []
    assert scene.pop_ticks(0.4) == [(0, 0)]


def test_a_silent_stack_is_waited_for_twice() -> None:
    scene = SceneJoin(LOCKSTEP).truth(0, 1, 2)
    assert scene.pop_ticks(10.2) == [(0, 0)]
    assert scene.pop_ticks(10.2) == [(1, 0), (2, 0)]
    assert scene.truth(3).pop_ticks() == [(3, 0)]
    scene.answer(3)
    assert scene.truth(4).pop_ticks(9.8) == []
    assert scene.answer(4).pop_ticks() == [(4, 2)]
    assert (scene.join.counts.missed, scene.join.counts.late) == (4, 2)


def test_one_of_two_topics_may_fall_silent() -> None:
    scene = SceneJoin(LOCKSTEP).truth(0).answer(0)
    scene.pop_ticks()
    for tick in (1, 2):
        assert scene.truth(tick).answer(tick, "/boxes").pop_ticks(10.2) == [(tick, 1)]
    assert scene.truth(3).pop_ticks(9.8) == []
    assert scene.answer(3, "/boxes").pop_ticks() == [(3, 1)]
    assert scene.join.counts.missed == 3


def test_time_between_polls_does_not_count_as_waiting() -> None:
    scene = SceneJoin(LOCKSTEP).truth(0)
    scene.now_s += 1000.0
    assert scene.pop_ticks(9.0) == []


def test_truth_is_waited_for_in_lockstep() -> None:
    scene = SceneJoin(LOCKSTEP).answer(0)
    scene.join.add_truth(POSE, 0, "pose")
    assert scene.pop_ticks(30.0) == []


def test_live_frames_wait_for_the_grace_ticks() -> None:
    scene = SceneJoin(LIVE).truth(0, 1, 2, 3).answer(2)
    assert scene.pop_ticks() == []
    assert scene.truth(4).pop_ticks() == [(0, 0)]
    assert scene.answer(1).pop_ticks() == [(1, 2), (2, 2)]


def test_live_frames_without_truth_or_input_do_not_count() -> None:
    scene = SceneJoin(LIVE)
    for tick in range(3):
        scene.join.add_truth(POSE, tick, "pose")
    scene.join.add_truth(BOXES, 1, "boxes")
    scene.join.add_truth(LABELS, 1, "labels")
    scene.truth(2).answer(2)
    assert scene.pop_ticks() == []
    for tick in range(3, 6):
        scene.join.add_truth(POSE, tick, "pose")
    assert scene.pop_ticks() == [(2, 2)]
    assert (scene.join.counts.without_truth, scene.join.counts.without_input, scene.join.counts.missed) == (1, 1, 0)


def test_ticks_without_input_have_no_frames() -> None:
    scene = SceneJoin(LOCKSTEP, period=2).truth(0, 1, 2).answer(0).answer(1).answer(2)
    assert scene.pop_ticks() == [(0, 2), (2, 2)]
    assert scene.join.counts.late == 0


def test_a_topic_that_never_answered_is_not_waited_for_again() -> None:
    scene = SceneJoin(LOCKSTEP).truth(0).answer(0, "/boxes")
    assert scene.pop_ticks(10.2) == [(0, 1)]
    assert scene.truth(1).answer(1, "/boxes").pop_ticks() == [(1, 1)]
    assert scene.answer(2, "/bev").truth(2).pop_ticks() == []  # the topic answers after all
    assert scene.join.counts.missed == 1


def test_answers_after_their_frame_has_left_are_late() -> None:
    scene = SceneJoin(LOCKSTEP).truth(0, 1).answer(1)
    scene.pop_ticks()
    scene.answer(0)
    assert scene.join.counts.late == 2


def test_a_second_answer_to_a_frame_is_refused() -> None:
    with pytest.raises(InputError, match=r"^/boxes: tick 0 is answered twice; each frame may be answered once$"):
        SceneJoin(LOCKSTEP).answer(0, "/boxes").answer(0, "/boxes")
    scene = SceneJoin(LOCKSTEP, topics=["/boxes"]).truth(0).answer(0, "/boxes")
    assert scene.pop_ticks() == [(0, 1)]
    with pytest.raises(InputError, match=r"^/boxes: tick 0 is answered twice"):
        scene.answer(0, "/boxes")


def test_live_a_later_answer_replaces_one_from_before_a_restart() -> None:
    scene = SceneJoin(LIVE, topics=["/boxes"]).answer(1, "/boxes", at_s=90.0).truth(0, 1).answer(0, "/boxes")
    scene.join.add_answer("/boxes", 1, "again", 102.0)
    first, second = scene.join.pop_ready_frames(scene.now_s)
    assert (first.tick, second.answers, second.answered_s) == (0, {"/boxes": "again"}, 102.0)


def test_the_scene_is_over_when_the_last_frame_has_left() -> None:
    scene = SceneJoin(LIVE).truth(0, 1).answer(0)
    scene.join.end_scene(1)
    assert scene.pop_ticks() == [(0, 2)]
    assert not scene.join.is_over
    assert scene.pop_ticks(2.2) == [(1, 0)]
    assert scene.join.is_over


def test_live_late_answers_do_not_delay_the_end() -> None:
    scene = SceneJoin(LIVE).truth(0, 1, 2, 3, 4, 5, 6)
    assert scene.pop_ticks() == [(0, 0), (1, 0), (2, 0)]
    scene.join.end_scene(6)
    for tick in range(2):
        assert scene.answer(tick).pop_ticks(0.8) == []
    assert scene.answer(2).pop_ticks(0.8) == [(tick, 0) for tick in range(3, 7)]
    assert scene.join.is_over
    assert (scene.join.counts.missed, scene.join.counts.late) == (7, 6)


def test_live_the_end_is_reached_even_if_truth_is_lost() -> None:
    scene = SceneJoin(LIVE).truth(0).answer(0)
    scene.join.end_scene(2)
    assert scene.pop_ticks(2.2) == [(0, 2)]
    assert scene.join.is_over
    assert scene.join.counts.without_truth == 2


def test_a_frame_waits_for_the_poses_of_other_agents() -> None:
    join = AnswerJoin(lambda tick: True, LOCKSTEP, [pose_of("car")])
    join.add_topic("/boxes")
    for part in (POSE, BOXES, LABELS):
        join.add_truth(part, 0, part)
    join.add_answer("/boxes", 0, "answer", 0.0)
    assert not [*join.pop_ready_frames(0.0)]
    join.add_truth(pose_of("car"), 0, "pose of the car")
    [frame] = join.pop_ready_frames(0.1)
    assert frame.truth[pose_of("car")] == "pose of the car"
    assert (join.counts.missed, join.counts.without_truth) == (0, 0)
