"""Messages of several sensors, put together by tick."""

from collections.abc import Iterable, Iterator, Mapping
from typing import Generic, TypeVar

_Tick = TypeVar("_Tick")
_Message = TypeVar("_Message")


class SensorJoin(Generic[_Tick, _Message]):
    """Ticks wait for what is due at them and are given out in their order.

    With a patience, a tick that is so far behind the newest one goes without what has not come.
    """

    def __init__(self, periods: Mapping[str, int], patience_ticks: int | None = None) -> None:
        """For one scene.

        Args:
            periods: By sensor, every how many ticks it sends a message, from tick 0 on.
            patience_ticks: None: wait for ever.
        """
        self._periods, self._patience_ticks = dict(periods), patience_ticks
        self._waiting: dict[int, _Tick] = {}
        self._messages: dict[int, dict[str, _Message]] = {}
        self._last_tick = -1

    def give_up(self, sensors: Iterable[str]) -> None:
        """Wait for these sensors no longer."""
        for sensor in sensors:
            self._periods.pop(sensor, None)

    def expect(self, tick: int, what: _Tick) -> None:
        """A tick, later than those before, waits for its messages."""
        self._waiting[tick] = what

    def add(self, sensor: str, tick: int, message: _Message) -> None:
        """A message, which may come before its tick; what comes after it has gone is too late."""
        if tick > self._last_tick:
            self._messages.setdefault(tick, {})[sensor] = message

    def ready(self) -> Iterator[tuple[_Tick, dict[str, _Message]]]:
        """The ticks that need not wait any longer, with the messages that have come."""
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
        come = self._messages.get(tick, {})
        return all(sensor in come for sensor, period in self._periods.items() if tick % period == 0)

    def _is_overdue(self, tick: int) -> bool:
        return self._patience_ticks is not None and next(reversed(self._waiting)) - tick >= self._patience_ticks
