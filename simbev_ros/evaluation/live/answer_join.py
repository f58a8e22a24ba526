"""Joins the messages of a running scene into complete frames, for live evaluation.

``AnswerJoin`` receives ground truth, the stack's input and the stack's answers in any order, each with its tick. It
releases frames in the order of the ticks, to be evaluated by ``live_evaluation``. There is a frame at every tick with
labels at which the stack's input is due. A frame leaves the join once its ground truth is there and each kind of answer
that the stack gives has arrived or can no longer be expected. The code reads no clock: the caller passes the time.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.tick_join import TickJoin

POSE, BOXES, LABELS = "pose", "boxes", "labels"
"""Parts of the ground truth of a frame; poses arrive at all ticks."""
_OWN_TRUTH = (POSE, BOXES, LABELS)
_INPUT = "input"
_MAX_POLL_GAP_S = 0.25
"""Upper bound on the waiting time that one poll adds: during a long computation, unread messages pile up."""
_WAIT_AFTER_REPORT_S = 1.0
_MAX_UNANSWERED = 2


def pose_of(agent: str) -> str:
    """Pose of another agent as a part of the ground truth, because answers may be in its frames."""
    return f"{POSE} of {agent}"


@dataclass(frozen=True, slots=True)
class WaitLimits:
    """Limits on how long frames wait for answers.

    In lockstep, a topic that failed to answer within ``idle_s`` twice in a row is not waited for until it sends again.

    Attributes:
        grace_ticks: Live: a frame waits until the ground truth is this number of ticks ahead. None: lockstep, where no
            message is lost, so an answer to a later frame means that there is none to this one.
        idle_s: A frame waits until nothing has arrived for this time, s; for one second if the stack has reported the
            tick as finished. Live, this is also the limit for answers after the end of the scene.
    """

    grace_ticks: int | None
    idle_s: float


@dataclass(slots=True)
class OpenFrame:
    """Data of one frame that have arrived when it leaves.

    Attributes:
        tick: Index of the frame in the scene.
        truth: Ground truth by part: (4, 4) map_from_ego, (N,) ``BOX_DTYPE``, (H, W) labels; and the poses of other
            agents.
        answers: ``PredictedBoxes`` or ``ScoreGrid``, by topic.
        input_s: Time when the input arrived, on any clock; None: it has not.
        answered_s: Time when the last answer arrived, on the same clock.
        is_complete: Whether there is an answer of every kind.
    """

    tick: int
    truth: dict[str, Any] = field(default_factory=dict)
    answers: dict[str, Any] = field(default_factory=dict)
    input_s: float | None = None
    answered_s: float = 0.0
    is_complete: bool = False


@dataclass(slots=True)
class JoinCounts:
    """Numbers of frames and answers with problems.

    Attributes:
        missed: Frames that lack an answer of some kind.
        late: Answers that arrived after their frame had left.
        without_input: Live: frames that are not evaluated as a sensor dropped its message and nothing was answered.
        without_truth: Live: frames that are not evaluated because their ground truth was lost.
        malformed: Answers that could not be used: their content, or their stamp, is not as it must be.
    """

    missed: int = 0
    late: int = 0
    without_input: int = 0
    without_truth: int = 0
    malformed: int = 0


class AnswerJoin:
    """Joins the frames of one scene.

    Args:
        is_due: Whether there is a frame at a tick.
        limits: Limits on how long frames wait.
        other_poses: Further parts of the ground truth, the poses of other agents (``pose_of``).

    Attributes:
        counts: Counts of the frames that have left and of late answers.
    """

    def __init__(self, is_due: Callable[[int], bool], limits: WaitLimits, other_poses: Iterable[str] = ()) -> None:
        self._is_due, self._limits = is_due, limits
        self._parts = (*_OWN_TRUTH, *other_poses)
        self._join: TickJoin[None, Any] = TickJoin(lambda _, tick: self._may_finish(tick), capacity=None)
        self._join.open(0, None)
        self._topics: dict[str, None] = {}
        self._answered: set[tuple[str, int]] = set()
        self._silent: set[str] = set()
        self._unanswered: Counter[str] = Counter()
        self._stack_tick = -1
        self._last_poll_s: float | None = None
        self._idle_s = self._ended_s = 0.0
        self._last_tick: int | None = None
        self.counts = JoinCounts()

    @property
    def finished_tick(self) -> int:
        """The last tick up to which all frames have left; -1: there is none."""
        return -1 if self._join.left is None else self._join.left

    @property
    def is_over(self) -> bool:
        """Whether all frames of the scene have left."""
        return self._last_tick is not None and self.finished_tick >= self._last_tick

    def add_topic(self, topic: str) -> None:
        """Register a topic of answers; frames wait for it until it turns out that nothing is sent on it."""
        self._topics.setdefault(topic)

    def add_truth(self, part: str, tick: int, value: Any) -> None:
        """Add a part of the ground truth, with a value as in ``OpenFrame``; each part in the order of the ticks."""
        self._idle_s = 0.0
        self._join.add(part, tick, value)

    def add_input(self, tick: int, arrival_s: float) -> None:
        """Record the arrival of the stack's input."""
        self._idle_s = 0.0
        self._join.add(_INPUT, tick, arrival_s)

    def add_answer(self, topic: str, tick: int, value: Any, arrival_s: float) -> None:
        """Add an answer, even to a tick that has no frame.

        Live, a later answer to the same tick replaces the earlier one: a live scene may restart while an answer to its
        previous run is on its way.

        Raises:
            InputError: In lockstep, this topic has already answered this tick.
        """
        self._idle_s = 0.0
        if (topic, tick) in self._answered and self._limits.grace_ticks is None:
            raise InputError(f"{topic}: tick {tick} is answered twice; each frame may be answered once")
        self._answered.add((topic, tick))
        self.add_topic(topic)
        self._silent.discard(topic)
        self._unanswered[topic] = 0
        if not self._join.add(topic, tick, (value, arrival_s)):
            self.counts.late += self._is_due(tick)

    def mark_stack_finished(self, tick: int) -> None:
        """Record that the stack has reported a tick as finished."""
        self._idle_s = 0.0
        self._stack_tick = max(self._stack_tick, tick)

    def end_scene(self, tick: int) -> None:
        """Record the last tick of the scene."""
        self._last_tick = tick

    def pop_ready_frames(self, now_s: float) -> Iterator[OpenFrame]:
        """Remove the frames that need not wait any longer, and yield those to evaluate; call it several times a second.

        Args:
            now_s: Time on a clock that never runs backwards, s.
        """
        if self._last_poll_s is not None:
            waited_s = min(now_s - self._last_poll_s, _MAX_POLL_GAP_S)
            self._idle_s += waited_s
            self._ended_s += 0.0 if self._last_tick is None else waited_s
        self._last_poll_s = now_s
        for tick, _, messages in self._join.release():
            self._join.open(tick + 1, None)
            if self._is_due(tick):
                if self._limits.grace_ticks is None and self._is_idle:
                    self._unanswered.update(topic for topic in self._awaited_topics() if topic not in messages)
                    self._idle_s = 0.0
                frame = self._frame(tick, messages)
                if self._count_frame(frame):
                    yield frame

    def _frame(self, tick: int, messages: Mapping[str, Any]) -> OpenFrame:
        """The frame of a tick that has left with these messages."""
        truth = {part: messages[part] for part in self._parts if part in messages}
        answered = {topic: messages[topic] for topic in self._topics if topic in messages}
        answers = {topic: value for topic, (value, _) in answered.items()}
        answered_s = max((arrival_s for _, arrival_s in answered.values()), default=0.0)
        return OpenFrame(tick, truth, answers, messages.get(_INPUT), answered_s)

    @property
    def _is_idle(self) -> bool:
        """Whether nothing has arrived for the idle time."""
        return self._idle_s >= self._limits.idle_s

    def _may_finish(self, tick: int) -> bool:
        """Whether nothing more is expected for a tick."""
        if self.is_over:
            return False
        is_live, is_idle, join = self._limits.grace_ticks is not None, self._is_idle, self._join
        if not join.is_past(POSE, tick - 1):
            return is_live and is_idle and self._last_tick is not None
        if not self._is_due(tick):
            return True
        if missing := [part for part in self._parts if not join.has(part, tick)]:
            return any(join.is_past(part, tick) for part in missing) or (is_live and is_idle)
        is_past = is_live and self._ended_s >= self._limits.idle_s
        return is_idle or is_past or all(self._is_settled(topic, tick) for topic in self._awaited_topics())

    def _awaited_topics(self) -> list[str]:
        """Topics that are waited for: all but those that were silent while others answered."""
        return [topic for topic in self._topics if topic not in self._silent]

    def _is_settled(self, topic: str, tick: int) -> bool:
        """Whether the answer on a topic has arrived, or will not arrive any more."""
        if self._join.has(topic, tick) or self._unanswered[topic] >= _MAX_UNANSWERED:
            return True
        if self._stack_tick >= tick and self._idle_s >= _WAIT_AFTER_REPORT_S:
            return True
        if self._limits.grace_ticks is not None:
            return self._join.is_past(POSE, tick + self._limits.grace_ticks - 1)
        return self._join.is_past(topic, tick)

    def _count_frame(self, frame: OpenFrame) -> bool:
        """Update the counts with a frame that leaves, and return whether it is evaluated."""
        if len(frame.truth) < len(self._parts):
            self.counts.without_truth += 1
            return False
        if self._limits.grace_ticks is not None and frame.input_s is None and not frame.answers:
            self.counts.without_input += 1
            return False
        awaited = self._awaited_topics()
        missing = [topic for topic in awaited if topic not in frame.answers]
        frame.is_complete = bool(awaited) and not missing
        self.counts.missed += not frame.is_complete
        if frame.answers:  # the stack answers, but never on these topics
            self._silent.update(topic for topic in missing if self._join.newest(topic) is None)
        return True
