"""Joins messages by tick, for everything that needs several messages of one tick.

This is the place where late messages are dropped: a message is late if its tick has left the join. Ticks leave by a
policy: in order, each when all of its messages are there or patience has run out; or only the newest one that has all
of its messages. Ticks may be stamps as well. The module needs nothing but Python.
"""

from collections.abc import Callable, Collection, Iterator, Mapping
from typing import Any, Generic, TypeVar

Item = TypeVar("Item")
Message = TypeVar("Message")

_CAPACITY = 64
"""Number of messages of a stream that may wait; the lockstep window allows 8."""


class TickJoin(Generic[Item, Message]):
    """Holds messages of several streams until the tick that they belong to leaves; each tick leaves once.

    Args:
        is_ready: The policy: whether a tick that is open may leave, given the join, as ``all_of`` makes one.
        newest: Whether only the newest tick that is ready leaves; earlier ones, ready or not, never do.
        sample_of: If not all ticks are opened: the tick of the message that a stream contributes to a tick. Then only
            the newest message and those for open ticks are kept. Left out, it is the tick itself, and all are kept.
        capacity: Maximum number of messages of a stream that wait. Beyond it, the farthest ahead is dropped, which
            strangers may have sent; with ``newest``, the one that has waited longest. None: there is no limit.

    Attributes:
        left: The newest tick that has left; None: none has.
        late: Number of messages that were late.
    """

    def __init__(
        self,
        is_ready: Callable[["TickJoin[Any, Any]", int], bool],
        *,
        newest: bool = False,
        sample_of: Callable[[str, int], int] | None = None,
        capacity: int | None = _CAPACITY,
    ) -> None:
        self._is_ready, self._newest_only, self._capacity = is_ready, newest, capacity
        self._sample_of = sample_of
        self._open: dict[int, Item] = {}
        self._messages: dict[str, dict[int, Message]] = {}
        self._newest: dict[str, int] = {}
        self.left: int | None = None
        self.late = 0

    @property
    def open_ticks(self) -> Collection[int]:
        """Ticks that have been opened and have not left."""
        return self._open.keys()

    def open(self, tick: int, item: Item) -> None:
        """Let a tick wait for its messages, some of which may be there already; ``item`` leaves with them."""
        if self.is_late(tick):
            self.late += 1
        else:
            self._open[tick] = item
            self._limit(self._open)

    def add(self, stream: str, tick: int, message: Message) -> bool:
        """Keep a message instead of an earlier one of its tick; return False if it is late, and dropped."""
        self._newest[stream] = max(tick, self._newest.get(stream, tick))
        if self.is_late(tick):
            self.late += 1
            return False
        held = self._messages.setdefault(stream, {})
        held[tick] = message
        self._limit(held)
        if self._sample_of is not None:
            kept = {self._newest[stream], *(self._sample_of(stream, each) for each in self._open)}
            for old in held.keys() - kept:
                del held[old]
        return True

    def is_late(self, tick: int) -> bool:
        """Whether messages of a tick are late."""
        return self.left is not None and tick <= self.left

    def message(self, stream: str, tick: int) -> Message | None:
        """A message that waits."""
        return self._messages.get(stream, {}).get(tick)

    def has(self, stream: str, tick: int) -> bool:
        """Whether a message waits."""
        return tick in self._messages.get(stream, ())

    def newest(self, stream: str) -> int | None:
        """The newest tick of which a message of a stream has come; None: none has."""
        return self._newest.get(stream)

    def is_past(self, stream: str, tick: int) -> bool:
        """Whether a stream has gone on to a later tick; where messages come in order, that of the tick is lost."""
        newest = self._newest.get(stream)
        return newest is not None and newest > tick

    def release(self) -> Iterator[tuple[int, Item, dict[str, Message]]]:
        """Let the ticks leave that are ready; yield each with its item and its messages by stream."""
        while (tick := self._next_ready()) is not None:
            item = self._open[tick]
            yield tick, item, self.take(tick)

    def take(self, tick: int) -> dict[str, Message]:
        """Let a tick leave, open or not, and return its messages; what belongs to earlier ticks is dropped."""
        messages = {}
        for name, held in self._messages.items():
            sample = tick if self._sample_of is None else self._sample_of(name, tick)
            if sample in held:
                messages[name] = held[sample]
            _drop_until(sample, held)
        _drop_until(tick, self._open)
        self.left = tick
        return messages

    def _next_ready(self) -> int | None:
        if self._newest_only:
            return max((tick for tick in self._open if self._is_ready(self, tick)), default=None)
        first = min(self._open, default=None)
        return first if first is not None and self._is_ready(self, first) else None

    def _limit(self, waiting: dict[int, Any]) -> None:
        if self._capacity is not None and len(waiting) > self._capacity:
            del waiting[next(iter(waiting)) if self._newest_only else max(waiting)]


def _drop_until(tick: int, waiting: dict[int, Any]) -> None:
    for old in [each for each in waiting if each <= tick]:
        del waiting[old]


def all_of(
    due: Callable[[int], Collection[str]], *, patience_ticks: int | None = None, in_order: bool = False
) -> Callable[[TickJoin[Any, Any], int], bool]:
    """The policy that a tick waits for a message of each stream that has one at it.

    Args:
        due: Names of the streams that have a message at a tick.
        patience_ticks: A tick is ready without what it lacks when the newest open tick is this far ahead. None: it
            waits without limit.
        in_order: Whether messages of a stream come in order but may be lost: then a tick does not wait for a stream
            that has gone on.
    """

    def is_ready(join: TickJoin[Any, Any], tick: int) -> bool:
        if patience_ticks is not None and max(join.open_ticks) - tick >= patience_ticks:
            return True
        return all(join.has(name, tick) or (in_order and join.is_past(name, tick)) for name in due(tick))

    return is_ready


def at_periods(periods: Mapping[str, int]) -> Callable[[int], Collection[str]]:
    """Streams that are due at a tick, for ``all_of``.

    Args:
        periods: Number of ticks between messages, by stream; the first one is due at tick 0. It may change later.
    """
    return lambda tick: [name for name, period in periods.items() if tick % period == 0]
