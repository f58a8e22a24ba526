"""Which messages a scene must consist of, and which have come: the recorder's books.

The schedule of every topic is known before the scene starts. A tick is finished when all messages due at it, and at all
ticks before it, have come; at the end recorded must equal expected for every topic.
"""

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from itertools import pairwise

_MOST_RUNS = 8


class Verdict(Enum):
    """What the books say to one message: only an expected one belongs into the bag, and warm-up is not even counted."""

    EXPECTED = "expected"
    DUPLICATE = "duplicate"
    UNEXPECTED = "unexpected"
    WARM_UP = "warm-up"


@dataclass(frozen=True, slots=True)
class Schedule:
    """When a topic has a message: every ``period_ticks`` from ``first_tick`` on; with period 0, once, at any stamp.

    A sporadic one has any number of messages at any tick; how many in all is known when the scene ends. With more
    messages than one per tick, which must have period 1, they are stamped at equal distances from ``first_tick`` on,
    and those after one tick up to the next are due at the latter.
    """

    first_tick: int = 0
    period_ticks: int = 1
    sporadic: bool = False
    messages_per_tick: int = 1

    def due(self, ticks: int) -> range:
        """The messages of a scene of so many ticks, by their places on the grid of stamps, whose 0 is tick 0."""
        if self.sporadic:
            return range(0)
        if self.period_ticks == 0:
            return range(self.first_tick, min(self.first_tick + 1, ticks))
        per_tick = self.messages_per_tick
        return range(self.first_tick * per_tick, (ticks - 1) * per_tick + 1, self.period_ticks)

    def tick_of(self, place: int) -> int:
        """The tick at which the message of a place is due."""
        return -(-place // self.messages_per_tick)

    def place_of(self, since_start_ns: int, tick_ns: int) -> int | None:
        """The place of a stamp, nanoseconds since tick 0; None if it lies beside the grid."""
        if self.period_ticks == 0:
            return self.first_tick
        place = -(-since_start_ns * self.messages_per_tick // tick_ns)
        return place if place * tick_ns // self.messages_per_tick == since_start_ns else None


@dataclass(frozen=True, slots=True)
class TopicAccount:
    """One topic at the end of a scene."""

    expected: int
    recorded: int
    missing_ticks: tuple[int, ...]
    duplicates: int
    unexpected: int

    @property
    def balanced(self) -> bool:
        """Whether exactly what was due has come, and nothing else."""
        return self.recorded == self.expected and not (self.duplicates or self.unexpected)


@dataclass(frozen=True, slots=True)
class Report:
    """The books at the end of a scene; topics that were not scheduled have ``expected`` 0."""

    ticks: int
    topics: Mapping[str, TopicAccount]

    @property
    def complete(self) -> bool:
        """Whether every topic has all that was due. Surplus was kept out of the bag, so it spoils nothing."""
        return all(account.recorded >= account.expected for account in self.topics.values())

    def problems(self) -> list[str]:
        """One sentence for each topic that is not as it should be."""
        return [f"{topic}: {_describe(account)}" for topic, account in self.topics.items() if not account.balanced]

    def custom_data(self, scene: str) -> dict[str, str]:
        """The report as it is kept in the bag's description."""
        return {
            "scene": scene,
            "ticks": str(self.ticks),
            "complete": str(self.complete).lower(),
            "expected": json.dumps({topic: account.expected for topic, account in self.topics.items()}),
            "recorded": json.dumps({topic: account.recorded for topic, account in self.topics.items()}),
            "problems": json.dumps(self.problems()),
        }


class Accounting:
    """The books of one scene.

    Attributes:
        finished_tick: The last tick of which, and of all before it, everything has come; -1 at first.
    """

    def __init__(self, manifest: Mapping[str, Schedule], *, start_ns: int, tick_ns: int, ticks: int) -> None:
        self.finished_tick = -1
        self._manifest = manifest
        self._start_ns, self._tick_ns, self._ticks = start_ns, tick_ns, ticks
        self._sporadic = {topic: 0 for topic, entry in manifest.items() if entry.sporadic}
        self._announced: Mapping[str, int] = {}
        self._due = {topic: entry.due(ticks) for topic, entry in manifest.items()}
        self._missing = {topic: set(due) for topic, due in self._due.items()}
        self._awaited = [0] * ticks
        for topic, due in self._due.items():
            for place in due:
                self._awaited[manifest[topic].tick_of(place)] += 1
        self._duplicates: Counter[str] = Counter()
        self._unexpected: Counter[str] = Counter()
        self._advance()

    def add(self, topic: str, stamp_ns: int) -> Verdict:
        """Enter one message."""
        schedule = self._manifest.get(topic, Schedule())
        if stamp_ns < self._start_ns and schedule.period_ticks:
            return Verdict.WARM_UP
        place = schedule.place_of(stamp_ns - self._start_ns, self._tick_ns)
        if topic in self._sporadic and place is not None and place < self._ticks:
            self._sporadic[topic] += 1
            return Verdict.EXPECTED
        if place is None or place not in self._due.get(topic, ()):
            self._unexpected[topic] += 1
            return Verdict.UNEXPECTED
        if place not in self._missing[topic]:
            self._duplicates[topic] += 1
            return Verdict.DUPLICATE
        self._missing[topic].remove(place)
        self._awaited[schedule.tick_of(place)] -= 1
        self._advance()
        return Verdict.EXPECTED

    def end_at(self, ticks: int, sporadic: Mapping[str, int] | None = None) -> None:
        """The scene ends: nothing is due from tick number ``ticks`` on.

        Args:
            ticks: Of the whole scene.
            sporadic: Messages of sporadic topics that there are in all; of those not given, as many as have come.
        """
        self._ticks, self._announced = ticks, sporadic or {}
        for topic, schedule in self._manifest.items():
            self._due[topic] = self._due[topic][: len(schedule.due(ticks))]
            self._missing[topic].intersection_update(self._due[topic])
        self._awaited = self._awaited[:ticks]

    @property
    def is_finished(self) -> bool:
        """Whether everything has come up to the end that was announced."""
        all_sporadic = all(self._sporadic[topic] >= count for topic, count in self._announced.items())
        return all_sporadic and self.finished_tick + 1 >= self._ticks

    def awaited(self, tick: int) -> list[str]:
        """The topics of which a message of this tick has not come."""
        return [topic for topic in self._missing if tick in self._missing_ticks(topic)]

    def report(self) -> Report:
        """The books as they are now."""
        strangers = sorted(self._unexpected.keys() - self._due.keys())
        return Report(self._ticks, {topic: self._account(topic) for topic in [*self._due, *strangers]})

    def _account(self, topic: str) -> TopicAccount:
        missing = self._missing.get(topic, set())
        happened = self._sporadic.get(topic, 0)
        due = len(self._due.get(topic, range(0)))
        expected, recorded = due + self._announced.get(topic, happened), due - len(missing) + happened
        ticks = tuple(sorted(self._missing_ticks(topic)))
        return TopicAccount(expected, recorded, ticks, self._duplicates[topic], self._unexpected[topic])

    def _missing_ticks(self, topic: str) -> set[int]:
        return {self._manifest[topic].tick_of(place) for place in self._missing.get(topic, ())}

    def _advance(self) -> None:
        while self.finished_tick + 1 < self._ticks and not self._awaited[self.finished_tick + 1]:
            self.finished_tick += 1


def _describe(account: TopicAccount) -> str:
    parts = [f"{account.recorded} of {account.expected} messages"]
    if account.missing_ticks:
        parts.append(f"missing at ticks {_ranges(account.missing_ticks)}")
    if account.duplicates:
        parts.append(f"{account.duplicates} more came twice")
    if account.unexpected:
        parts.append(f"{account.unexpected} more came with a stamp that is not due")
    return ", ".join(parts)


def _ranges(ticks: Sequence[int]) -> str:
    """Ascending ticks in short, ``0-3, 7``; of many gaps the first few."""
    breaks = [i for i, (a, b) in enumerate(pairwise(ticks), start=1) if b != a + 1]
    runs = [ticks[a:b] for a, b in pairwise([0, *breaks, len(ticks)])]
    words = [str(run[0]) if len(run) == 1 else f"{run[0]}-{run[-1]}" for run in runs]
    return ", ".join([*words[:_MOST_RUNS], *(["..."] if len(words) > _MOST_RUNS else [])])
