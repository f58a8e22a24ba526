"""Joins the messages of several sensors by tick, for the annotator, whose boxes need all of them."""

from collections.abc import Iterable, Iterator, Mapping
from typing import Generic, TypeVar

_MAX_TICKS_AHEAD = 64
"""Messages farther ahead than any node can be are somebody else's."""

_Tick = TypeVar("_Tick")
_Message = TypeVar("_Message")


class SensorJoin(Generic[_Tick, _Message]):
    """Holds ticks back until the messages due at them have arrived, and releases them in order.

    With a patience, a tick that is at least that many ticks behind the newest one is released without the messages
    still missing.
    """

    def __init__(self, periods: Mapping[str, int], patience_ticks: int | None = None) -> None:
        """Start joining one scene.

        Args:
            periods: Number of ticks between messages, by sensor; the first message is due at tick 0.
            patience_ticks: None: wait without limit.
        """
        self._periods, self._patience_ticks = dict(periods), patience_ticks
        self._waiting: dict[int, _Tick] = {}
        self._messages: dict[int, dict[str, _Message]] = {}
        self._last_tick = -1

    def give_up(self, sensors: Iterable[str]) -> None:
        """Stop waiting for these sensors."""
        for sensor in sensors:
            self._periods.pop(sensor, None)

    def expect(self, tick: int, item: _Tick) -> None:
        """Let a tick, later than all earlier ones, wait for its messages; ``item`` is released with them."""
        self._waiting[tick] = item

    def is_awaited(self, sensor: str, tick: int) -> bool:
        """Whether a sensor's message of a tick is still to come; it may precede the tick, but not by far."""
        near = self._last_tick < tick <= self._last_tick + _MAX_TICKS_AHEAD
        return near and sensor not in self._messages.get(tick, {})

    def add_message(self, sensor: str, tick: int, message: _Message) -> None:
        """Store a message; it is dropped unless it is awaited."""
        if self.is_awaited(sensor, tick):
            self._messages.setdefault(tick, {})[sensor] = message

    def release(self) -> Iterator[tuple[_Tick, dict[str, _Message]]]:
        """Release the ticks that are complete or overdue, with their messages."""
        while self._waiting:
            tick = next(iter(self._waiting))
            if not self._is_complete(tick) and not self._is_overdue(tick):
                return
            self._last_tick = tick
            messages = self._messages.get(tick, {})
            for old in [other for other in self._messages if other <= tick]:
                del self._messages[old]
            yield self._waiting.pop(tick), messages

    def _is_complete(self, tick: int) -> bool:
        arrived = self._messages.get(tick, {})
        return all(sensor in arrived for sensor, period in self._periods.items() if tick % period == 0)

    def _is_overdue(self, tick: int) -> bool:
        return self._patience_ticks is not None and next(reversed(self._waiting)) - tick >= self._patience_ticks
