"""When frames leave: as soon as all is there, and without what will not come any more. Time is told by hand."""

from collections.abc import Iterable

import pytest

from simbev_ros.errors import InputError
from simbev_ros.evaluation.live.answer_join import BOXES, LABELS, POSE, AnswerJoin, WaitLimits

LOCKSTEP, LIVE = WaitLimits(None, 10.0), WaitLimits(4, 2.0)


class Scene:
    """A join with two topics of answers, and its clock."""

    def __init__(self, limits: WaitLimits, period: int = 1, topics: Iterable[str] = ("/boxes", "/bev")) -> None:
        self.join, self.now_s = AnswerJoin(lambda tick: tick % period == 0, limits), 0.0
        for topic in topics:
            self.join.add_topic(topic)
        self.leave()

    def truth(self, *ticks: int) -> "Scene":
        for tick in ticks:
            for part in (POSE, BOXES, LABELS):
                self.join.add_truth(part, tick, f"{part} {tick}")
            self.join.add_input(tick, 100.0 + tick)
        return self

    def answer(self, tick: int, *topics: str, at_s: float = 0.0) -> "Scene":
        for topic in topics or ("/boxes", "/bev"):
            self.join.add_answer(topic, tick, f"{topic} {tick}", at_s)
        return self

    def leave(self, after_s: float = 0.0) -> list[tuple[int, int]]:
        """Ticks that leave within a time, and how many answers each has; looked at ten times a second."""
        found = []
        for _ in range(round(after_s / 0.1) + 1):
            found += [(frame.tick, len(frame.answers)) for frame in self.join.pop_ready_frames(self.now_s)]
            self.now_s += 0.1
        return found


def test_a_frame_leaves_with_its_truth_and_answers_whatever_comes_first() -> None:
    scene = Scene(LOCKSTEP).answer(0, at_s=100.5)
    assert scene.leave() == []
    scene.truth(0)
    [frame] = scene.join.pop_ready_frames(scene.now_s)
    assert frame.truth == {POSE: "pose 0", BOXES: "boxes 0", LABELS: "labels 0"}
    assert frame.answers == {"/boxes": "/boxes 0", "/bev": "/bev 0"}
    assert (frame.input_s, frame.answered_s, frame.is_complete) == (100.0, 100.5, True)


def test_frames_leave_in_the_order_of_ticks() -> None:
    scene = Scene(LOCKSTEP).truth(0, 1).answer(1, "/boxes")
    assert scene.leave() == []
    assert scene.answer(0, "/boxes", "/bev").answer(1, "/bev").leave() == [(0, 2), (1, 2)]
    assert scene.join.finished_tick == 1


def test_in_lockstep_an_answer_to_a_later_frame_says_that_there_is_none() -> None:
    scene = Scene(LOCKSTEP).truth(0, 1).answer(1)
    assert scene.leave() == [(0, 0), (1, 2)]
    assert scene.join.counts.missed == 1


def test_a_topic_speaks_for_itself_only() -> None:
    scene = Scene(LOCKSTEP).truth(0, 1).answer(1, "/boxes").answer(0, "/boxes")
    assert scene.leave() == []
    assert scene.answer(1, "/bev").leave() == [(0, 1), (1, 2)]


def test_a_stack_that_has_finished_a_tick_has_a_second_left() -> None:
    scene = Scene(LOCKSTEP).truth(0, 1)
    scene.join.mark_stack_finished(0)
    assert scene.leave(0.8) == []
    assert scene.leave(0.4) == [(0, 0)]


def test_what_comes_sets_the_second_back() -> None:
    scene = Scene(LOCKSTEP).truth(0)
    scene.join.mark_stack_finished(0)
    assert scene.leave(0.8) == []
    assert scene.answer(0, "/boxes").leave(0.8) == []
    assert scene.leave(0.4) == [(0, 1)]


def test_nothing_waits_for_ever() -> None:
    scene = Scene(LOCKSTEP).truth(0)
    assert scene.leave(9.8) == []
    assert scene.leave(0.4) == [(0, 0)]


def test_a_stack_that_says_nothing_is_waited_for_twice() -> None:
    scene = Scene(LOCKSTEP).truth(0, 1, 2)
    assert scene.leave(10.2) == [(0, 0)]
    assert scene.leave(10.2) == [(1, 0), (2, 0)]
    assert scene.truth(3).leave() == [(3, 0)]
    scene.answer(3)
    assert scene.truth(4).leave(9.8) == []
    assert scene.answer(4).leave() == [(4, 2)]
    assert (scene.join.counts.missed, scene.join.counts.late) == (4, 2)


def test_of_two_topics_one_may_fall_silent() -> None:
    scene = Scene(LOCKSTEP).truth(0).answer(0)
    scene.leave()
    for tick in (1, 2):
        assert scene.truth(tick).answer(tick, "/boxes").leave(10.2) == [(tick, 1)]
    assert scene.truth(3).leave(9.8) == []
    assert scene.answer(3, "/boxes").leave() == [(3, 1)]
    assert scene.join.counts.missed == 3


def test_time_in_which_nobody_looked_is_not_waited() -> None:
    scene = Scene(LOCKSTEP).truth(0)
    scene.now_s += 1000.0
    assert scene.leave(9.0) == []


def test_truth_is_waited_for_in_lockstep() -> None:
    scene = Scene(LOCKSTEP).answer(0)
    scene.join.add_truth(POSE, 0, "pose")
    assert scene.leave(30.0) == []


def test_live_frames_wait_until_the_truth_is_far_ahead() -> None:
    scene = Scene(LIVE).truth(0, 1, 2, 3).answer(2)
    assert scene.leave() == []
    assert scene.truth(4).leave() == [(0, 0)]
    assert scene.answer(1).leave() == [(1, 2), (2, 2)]


def test_live_frames_without_truth_or_input_do_not_count() -> None:
    scene = Scene(LIVE)
    for tick in range(3):
        scene.join.add_truth(POSE, tick, "pose")
    scene.join.add_truth(BOXES, 1, "boxes")
    scene.join.add_truth(LABELS, 1, "labels")
    scene.truth(2).answer(2)
    assert scene.leave() == []
    for tick in range(3, 6):
        scene.join.add_truth(POSE, tick, "pose")
    assert scene.leave() == [(2, 2)]
    assert (scene.join.counts.without_truth, scene.join.counts.without_input, scene.join.counts.missed) == (1, 1, 0)


def test_at_ticks_without_input_there_are_no_frames() -> None:
    scene = Scene(LOCKSTEP, period=2).truth(0, 1, 2).answer(0).answer(1).answer(2)
    assert scene.leave() == [(0, 2), (2, 2)]
    assert scene.join.counts.late == 0


def test_a_topic_that_stays_silent_is_not_waited_for_twice() -> None:
    scene = Scene(LOCKSTEP).truth(0).answer(0, "/boxes")
    assert scene.leave(10.2) == [(0, 1)]
    assert scene.truth(1).answer(1, "/boxes").leave() == [(1, 1)]
    assert scene.answer(2, "/bev").truth(2).leave() == []  # it speaks after all
    assert scene.join.counts.missed == 1


def test_answers_after_their_frame_are_late() -> None:
    scene = Scene(LOCKSTEP).truth(0, 1).answer(1)
    scene.leave()
    scene.answer(0)
    assert scene.join.counts.late == 2


def test_a_frame_is_answered_once() -> None:
    with pytest.raises(InputError, match=r"^/boxes: tick 0 is answered twice; allowed is one answer to each frame$"):
        Scene(LOCKSTEP).answer(0, "/boxes").answer(0, "/boxes")
    scene = Scene(LOCKSTEP, topics=["/boxes"]).truth(0).answer(0, "/boxes")
    assert scene.leave() == [(0, 1)]
    with pytest.raises(InputError, match=r"^/boxes: tick 0 is answered twice"):
        scene.answer(0, "/boxes")


def test_live_a_later_answer_takes_the_place_of_one_from_before_a_new_start() -> None:
    scene = Scene(LIVE, topics=["/boxes"]).answer(1, "/boxes", at_s=90.0).truth(0, 1).answer(0, "/boxes")
    scene.join.add_answer("/boxes", 1, "again", 102.0)
    first, second = scene.join.pop_ready_frames(scene.now_s)
    assert (first.tick, second.answers, second.answered_s) == (0, {"/boxes": "again"}, 102.0)


def test_the_end_is_reached_when_the_last_frame_has_left() -> None:
    scene = Scene(LIVE).truth(0, 1).answer(0)
    scene.join.end_scene(1)
    assert scene.leave() == [(0, 2)]
    assert not scene.join.is_over
    assert scene.leave(2.2) == [(1, 0)]
    assert scene.join.is_over


def test_live_late_answers_do_not_put_off_the_end() -> None:
    scene = Scene(LIVE).truth(0, 1, 2, 3, 4, 5, 6)
    assert scene.leave() == [(0, 0), (1, 0), (2, 0)]
    scene.join.end_scene(6)
    for tick in range(2):
        assert scene.answer(tick).leave(0.8) == []
    assert scene.answer(2).leave(0.8) == [(tick, 0) for tick in range(3, 7)]
    assert scene.join.is_over
    assert (scene.join.counts.missed, scene.join.counts.late) == (7, 6)


def test_live_the_end_is_reached_although_its_truth_is_lost() -> None:
    scene = Scene(LIVE).truth(0).answer(0)
    scene.join.end_scene(2)
    assert scene.leave(2.2) == [(0, 2)]
    assert scene.join.is_over
    assert scene.join.counts.without_truth == 2
