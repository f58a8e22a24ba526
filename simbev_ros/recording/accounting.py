"""The recorder's accounts: which messages a scene must consist of, and which have arrived.

The schedule of every topic is known before the scene starts. A tick is finished when all messages due at it and at all
earlier ticks have arrived; at the end, recorded must equal expected for every topic.
"""

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from itertools import pairwise

_MAX_RUNS = 8


class Verdict(Enum):
    """Classification of a message: only an expected one belongs in the bag; warm-up messages are not even counted."""

    EXPECTED = "expected"
    DUPLICATE = "duplicate"
    UNEXPECTED = "unexpected"
    WARM_UP = "warm-up"


@dataclass(frozen=True, slots=True)
class Schedule:
    """Ticks at which a topic has messages: every ``period_ticks`` from ``first_tick`` on.

    With period 0 the topic has one message with any stamp. A sporadic topic has any number of messages at any tick;
    their total is known when the scene ends. With several messages per tick the period must be 1: the messages are
    stamped at equal intervals from ``first_tick`` on, and those after one tick and up to the next are due at the
    latter. Messages are numbered by slots of this grid of stamps; slot 0 is at tick 0.
    """

    first_tick: int = 0
    period_ticks: int = 1
    sporadic: bool = False
    messages_per_tick: int = 1

    def due(self, ticks: int) -> range:
        """Slots of the messages that are due in a scene with the given number of ticks."""
        if self.sporadic:
            return range(0)
        if self.period_ticks == 0:
            return range(self.first_tick, min(self.first_tick + 1, ticks))
        per_tick = self.messages_per_tick
        return range(self.first_tick * per_tick, (ticks - 1) * per_tick + 1, self.period_ticks)

    def tick_of(self, slot: int) -> int:
        """Tick at which the message of a slot is due."""
        return -(-slot // self.messages_per_tick)

    def slot_of(self, since_start_ns: int, tick_ns: int) -> int | None:
        """Slot of a stamp, given in nanoseconds since tick 0; None if the stamp is not on the grid."""
        if self.period_ticks == 0:
            return self.first_tick
        slot = -(-since_start_ns * self.messages_per_tick // tick_ns)
        return slot if slot * tick_ns // self.messages_per_tick == since_start_ns else None


@dataclass(frozen=True, slots=True)
class TopicAccount:
    """Account of one topic at the end of a scene: numbers of messages, and the ticks with missing ones.

    A topic that is contested has had a second sender: what is recorded may be that one's.
    """

    expected: int
    recorded: int
    missing_ticks: tuple[int, ...]
    duplicates: int
    unexpected: int
    is_contested: bool

    @property
    def balanced(self) -> bool:
        """Whether exactly the messages that were due have arrived, and no others."""
        return self.recorded == self.expected and not (self.duplicates or self.unexpected)


@dataclass(frozen=True, slots=True)
class Report:
    """Accounts of all topics at the end of a scene; topics that were not scheduled have ``expected`` 0."""

    ticks: int
    topics: Mapping[str, TopicAccount]

    @property
    def complete(self) -> bool:
        """Whether every topic has all messages that were due, from one sender.

        Surplus ones with other stamps are not in the bag, so they do no harm.
        """
        return all(each.recorded >= each.expected and not each.is_contested for each in self.topics.values())

    def problems(self) -> list[str]:
        """A sentence for each topic with missing or unexpected messages."""
        return [f"{topic}: {_describe(account)}" for topic, account in self.topics.items() if not account.balanced]

    def custom_data(self, scene: str) -> dict[str, str]:
        """The report as custom data of the bag's metadata: text by name, lists and mappings as JSON."""
        return {
            "scene": scene,
            "ticks": str(self.ticks),
            "complete": str(self.complete).lower(),
            "expected": json.dumps({topic: account.expected for topic, account in self.topics.items()}),
            "recorded": json.dumps({topic: account.recorded for topic, account in self.topics.items()}),
            "problems": json.dumps(self.problems()),
        }


class Accounting:
    """Accounts of one scene while it is recorded.

    Attributes:
        finished_tick: Last tick up to which all messages have arrived; -1 at first.
    """

    def __init__(self, manifest: Mapping[str, Schedule], *, start_ns: int, tick_ns: int, ticks: int) -> None:
        self.finished_tick = -1
        self._manifest = manifest
        self._start_ns, self._tick_ns, self._ticks = start_ns, tick_ns, ticks
        self._sporadic = {topic: 0 for topic, schedule in manifest.items() if schedule.sporadic}
        self._announced: dict[str, int] = {}
        self._due = {topic: schedule.due(ticks) for topic, schedule in manifest.items()}
        self._missing = {topic: set(due) for topic, due in self._due.items()}
        self._num_awaited = [0] * ticks
        for topic, due in self._due.items():
            for slot in due:
                self._num_awaited[manifest[topic].tick_of(slot)] += 1
        self._duplicates: Counter[str] = Counter()
        self._unexpected: Counter[str] = Counter()
        self._advance_finished_tick()

    def add_message(self, topic: str, stamp_ns: int) -> Verdict:
        """Enter a message and classify it."""
        schedule = self._manifest.get(topic, Schedule())
        if stamp_ns < self._start_ns and schedule.period_ticks:
            return Verdict.WARM_UP
        slot = schedule.slot_of(stamp_ns - self._start_ns, self._tick_ns)
        if topic in self._sporadic and slot is not None and slot < self._ticks:
            self._sporadic[topic] += 1
            return Verdict.EXPECTED
        if slot is None or slot not in self._due.get(topic, ()):
            self._unexpected[topic] += 1
            return Verdict.UNEXPECTED
        if slot not in self._missing[topic]:
            self._duplicates[topic] += 1
            return Verdict.DUPLICATE
        self._missing[topic].remove(slot)
        self._num_awaited[schedule.tick_of(slot)] -= 1
        self._advance_finished_tick()
        return Verdict.EXPECTED

    def end_at(self, ticks: int, sporadic: Mapping[str, int] | None = None) -> None:
        """Announce the end of the scene: nothing is due from tick number ``ticks`` on.

        Args:
            ticks: Number of ticks of the whole scene.
            sporadic: Total number of messages of sporadic topics; for topics not given, the messages that have arrived.
        """
        self._ticks, self._announced = ticks, dict(sporadic or {})
        for topic, schedule in self._manifest.items():
            self._due[topic] = self._due[topic][: len(schedule.due(ticks))]
            self._missing[topic].intersection_update(self._due[topic])
        self._num_awaited = self._num_awaited[:ticks]

    def announce(self, topic: str, messages: int) -> None:
        """Announce the total number of messages of a sporadic topic, once the end is known."""
        if topic in self._sporadic:
            self._announced[topic] = messages

    @property
    def is_finished(self) -> bool:
        """Whether all messages up to the announced end have arrived."""
        all_sporadic = all(self._sporadic[topic] >= count for topic, count in self._announced.items())
        return all_sporadic and self.finished_tick + 1 >= self._ticks

    def report(self) -> Report:
        """Report on the current state of the accounts."""
        unscheduled = sorted(self._unexpected.keys() - self._due.keys())
        return Report(self._ticks, {topic: self._account(topic) for topic in [*self._due, *unscheduled]})

    def _account(self, topic: str) -> TopicAccount:
        missing = self._missing.get(topic, set())
        sporadic_count = self._sporadic.get(topic, 0)
        due = len(self._due.get(topic, range(0)))
        expected, recorded = due + self._announced.get(topic, sporadic_count), due - len(missing) + sporadic_count
        ticks = tuple(sorted(self._missing_ticks(topic)))
        duplicates, schedule = self._duplicates[topic], self._manifest.get(topic)
        # The value of a latched topic may come again for a new subscription.
        is_contested = duplicates > 0 and schedule is not None and schedule.period_ticks > 0
        return TopicAccount(expected, recorded, ticks, duplicates, self._unexpected[topic], is_contested)

    def _missing_ticks(self, topic: str) -> set[int]:
        return {self._manifest[topic].tick_of(slot) for slot in self._missing.get(topic, ())}

    def _advance_finished_tick(self) -> None:
        while self.finished_tick + 1 < self._ticks and not self._num_awaited[self.finished_tick + 1]:
            self.finished_tick += 1


def _describe(account: TopicAccount) -> str:
    parts = [f"{account.recorded} of {account.expected} messages"]
    if account.missing_ticks:
        parts.append(f"missing at ticks {_ranges(account.missing_ticks)}")
    if account.duplicates:
        by = " from a second sender" if account.is_contested else ""
        parts.append(f"{account.duplicates} more came twice{by}")
    if account.unexpected:
        parts.append(f"{account.unexpected} more came with a stamp that is not due")
    return ", ".join(parts)


def _ranges(ticks: Sequence[int]) -> str:
    """Text of ascending ticks as ranges, such as ``0-3, 7``; at most ``_MAX_RUNS`` of them."""
    breaks = [i for i, (a, b) in enumerate(pairwise(ticks), start=1) if b != a + 1]
    runs = [ticks[a:b] for a, b in pairwise([0, *breaks, len(ticks)])]
    words = [str(run[0]) if len(run) == 1 else f"{run[0]}-{run[-1]}" for run in runs]
    return ", ".join([*words[:_MAX_RUNS], *(["..."] if len(words) > _MAX_RUNS else [])])
