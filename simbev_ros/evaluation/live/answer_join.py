"""Frames of a running scene, put together of what comes of them in any order: truth, the stack's input and its answers.

A frame is one at which the stack's input is due. It leaves, in the order of the ticks, when its truth is there and each
kind of answer that the stack gives has come, or will not come any more. Pure: the time is told.
"""

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

from simbev_ros.errors import InputError

POSE, BOXES, LABELS = "pose", "boxes", "labels"
"""The truth of a frame; poses come at all ticks."""
_TRUTH = (POSE, BOXES, LABELS)
_LONGEST_LOOK_S = 0.25
"""Time that passes unobserved, while something is computed, is not waited: messages lie there that were not read."""
_AFTER_REPORT_S = 1.0
_MOST_IN_VAIN = 2


@dataclass(frozen=True, slots=True)
class Patience:
    """How long frames wait for answers.

    Attributes:
        grace_ticks: Live: until the truth is so many ticks ahead; None: lockstep, where nothing is lost, so that an
            answer to a later frame says that there is none to this one.
        idle_s: Until nothing has come for so long; one second where the stack has said that it has finished the tick.
            Live, answers are waited for no longer than that after the end.
            In lockstep, a topic that was waited for in vain twice is not waited for before it speaks again.
    """

    grace_ticks: int | None
    idle_s: float


@dataclass(slots=True)
class OpenFrame:
    """What has come of a frame.

    Attributes:
        tick: Its place in the scene.
        truth: By part: (4, 4) map_from_ego, (N,) ``BOX_DTYPE``, (H, W) labels.
        answers: By topic: ``PredictedBoxes`` or ``ScoreGrid``.
        input_s: When the input came, on some clock.
        answered_s: When the last answer came, on the same.
        is_complete: Of a frame that has left: there is an answer of every kind.
    """

    tick: int
    truth: dict[str, Any] = field(default_factory=dict)
    answers: dict[str, Any] = field(default_factory=dict)
    input_s: float | None = None
    answered_s: float = 0.0
    is_complete: bool = False


@dataclass(slots=True)
class Books:
    """What became of frames and answers.

    Attributes:
        missed: Frames that lack an answer of some kind.
        late: Answers that came after their frame had left.
        without_input: Live: frames that are not evaluated, as a sensor left its message out, and nothing was answered.
        without_truth: Live: frames that are not evaluated, as their truth was lost.
    """

    missed: int = 0
    late: int = 0
    without_input: int = 0
    without_truth: int = 0


class AnswerJoin:
    """Joins the frames of one scene.

    Args:
        is_due: Whether there is a frame at a tick.
        patience: How long frames wait.

    Attributes:
        books: Of what has left.
        finished_tick: The last tick of which nothing is open, nor of those before; -1: there is none.
    """

    def __init__(self, is_due: Callable[[int], bool], patience: Patience) -> None:
        self._is_due, self._patience = is_due, patience
        self._frames: dict[int, OpenFrame] = {}
        self._newest = dict.fromkeys(_TRUTH, -1)
        self._newest_answer: dict[str, int | None] = {}
        self._answered: set[tuple[str, int]] = set()
        self._silent: set[str] = set()
        self._in_vain: Counter[str] = Counter()
        self._stack_tick = -1
        self._looked_s: float | None = None
        self._idle_s = self._ended_s = 0.0
        self._last_tick: int | None = None
        self.books = Books()
        self.finished_tick = -1

    @property
    def is_over(self) -> bool:
        """Whether all frames of the scene have left."""
        return self._last_tick is not None and self.finished_tick >= self._last_tick

    def offer(self, topic: str) -> None:
        """There is a topic of answers: frames wait for it, until it turns out that nothing comes on it."""
        self._newest_answer.setdefault(topic, None)

    def add_truth(self, part: str, tick: int, value: Any) -> None:
        """A part of the truth, as ``OpenFrame`` has them; each in the order of the ticks."""
        self._idle_s = 0.0
        self._newest[part] = max(self._newest[part], tick)
        if (frame := self._frame(tick)) is not None:
            frame.truth[part] = value

    def add_input(self, tick: int, at_s: float) -> None:
        """The stack's input has come."""
        self._idle_s = 0.0
        if (frame := self._frame(tick)) is not None:
            frame.input_s = at_s

    def add_answer(self, topic: str, tick: int, value: Any, at_s: float) -> None:
        """An answer, be it to a tick that has no frame. Live, a later one to the same tick takes its place.

        A live scene may start again, while an answer is on its way that was meant for what it was before.

        Raises:
            InputError: In lockstep, there was one of this topic to this tick.
        """
        self._idle_s = 0.0
        if (topic, tick) in self._answered and self._patience.grace_ticks is None:
            raise InputError(f"{topic}: tick {tick} is answered twice; allowed is one answer to each frame")
        self._answered.add((topic, tick))
        newest = self._newest_answer.get(topic)
        self._newest_answer[topic] = tick if newest is None else max(newest, tick)
        self._silent.discard(topic)
        self._in_vain[topic] = 0
        frame = self._frame(tick)
        if frame is None:
            self.books.late += self._is_due(tick)
            return
        frame.answers[topic] = value
        frame.answered_s = max(frame.answered_s, at_s)

    def stack_finished(self, tick: int) -> None:
        """The stack says that it has finished a tick."""
        self._idle_s = 0.0
        self._stack_tick = max(self._stack_tick, tick)

    def end(self, tick: int) -> None:
        """The scene ends with a tick."""
        self._last_tick = tick

    def leaving(self, now_s: float) -> Iterator[OpenFrame]:
        """The frames that need not wait any longer and are to be evaluated; to be asked several times a second.

        Args:
            now_s: On a clock that never runs backwards.
        """
        if self._looked_s is not None:
            waited_s = min(now_s - self._looked_s, _LONGEST_LOOK_S)
            self._idle_s += waited_s
            self._ended_s += 0.0 if self._last_tick is None else waited_s
        self._looked_s = now_s
        while not self.is_over and self._may_leave(tick := self.finished_tick + 1):
            frame = self._frames.pop(tick, None) or OpenFrame(tick)
            self.finished_tick = tick
            if self._is_due(tick):
                if self._patience.grace_ticks is None and self._is_idle:
                    self._in_vain.update(topic for topic in self._awaited() if topic not in frame.answers)
                    self._idle_s = 0.0
                if self._counts(frame):
                    yield frame

    def _frame(self, tick: int) -> OpenFrame | None:
        """That of a tick, unless it has left or there is none."""
        if tick <= self.finished_tick or not self._is_due(tick):
            return None
        return self._frames.setdefault(tick, OpenFrame(tick))

    @property
    def _is_idle(self) -> bool:
        return self._idle_s >= self._patience.idle_s

    def _may_leave(self, tick: int) -> bool:
        is_live, is_idle = self._patience.grace_ticks is not None, self._is_idle
        if self._newest[POSE] < tick:
            return is_live and is_idle and self._last_tick is not None
        if not self._is_due(tick):
            return True
        frame = self._frames.get(tick) or OpenFrame(tick)
        missing = [part for part in _TRUTH if part not in frame.truth]
        if missing:
            return any(self._newest[part] > tick for part in missing) or (is_live and is_idle)
        is_past = is_live and self._ended_s >= self._patience.idle_s
        return is_idle or is_past or all(self._is_settled(topic, frame) for topic in self._awaited())

    def _awaited(self) -> list[str]:
        return [topic for topic in self._newest_answer if topic not in self._silent]

    def _is_settled(self, topic: str, frame: OpenFrame) -> bool:
        """Whether an answer has come, or will not come any more."""
        if topic in frame.answers or self._in_vain[topic] >= _MOST_IN_VAIN:
            return True
        if self._stack_tick >= frame.tick and self._idle_s >= _AFTER_REPORT_S:
            return True
        if self._patience.grace_ticks is not None:
            return self._newest[POSE] >= frame.tick + self._patience.grace_ticks
        newest = self._newest_answer[topic]
        return newest is not None and newest > frame.tick

    def _counts(self, frame: OpenFrame) -> bool:
        """Whether a frame that leaves is evaluated; enters it into the books."""
        if len(frame.truth) < len(_TRUTH):
            self.books.without_truth += 1
            return False
        if self._patience.grace_ticks is not None and frame.input_s is None and not frame.answers:
            self.books.without_input += 1
            return False
        awaited = self._awaited()
        lacking = [topic for topic in awaited if topic not in frame.answers]
        frame.is_complete = bool(awaited) and not lacking
        self.books.missed += not frame.is_complete
        if frame.answers:  # something was answered, but never anything on these
            self._silent.update(topic for topic in lacking if self._newest_answer[topic] is None)
        return True
