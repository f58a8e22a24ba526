"""Joins the messages of one tick: its odometry, sent at every tick, and all inputs that are due.

Messages of different topics are not synchronized: any may arrive first, and live some never arrive.
"""

from collections.abc import Callable, Collection, Iterator
from typing import Generic, TypeVar

Message = TypeVar("Message")
Odometry = TypeVar("Odometry")

_MAX_WAITING = 100
"""Maximum number of waiting ticks; beyond it, the oldest is released without what it lacks."""


class TickJoin(Generic[Message, Odometry]):
    """Holds messages by stamp until their tick is complete."""

    def __init__(self) -> None:
        self._inputs: dict[str, dict[int, Message]] = {}
        self._odometry: dict[int, Odometry] = {}

    def clear(self) -> None:
        """Forget all messages."""
        self._inputs.clear()
        self._odometry.clear()

    def add_input(self, name: str, stamp_ns: int, message: Message) -> None:
        """Store a message of an input."""
        self._inputs.setdefault(name, {})[stamp_ns] = message

    def add_odometry(self, stamp_ns: int, odometry: Odometry) -> None:
        """Store the odometry of a tick."""
        self._odometry[stamp_ns] = odometry

    def release_complete(
        self, due: Callable[[int], Collection[str]]
    ) -> Iterator[tuple[int, Odometry, dict[str, Message]]]:
        """Release stamp, odometry and messages by input of each complete tick, in order and once.

        Args:
            due: Names of the inputs that have a message at a stamp. A message counts as lost when a later one of the
                same input has arrived.
        """
        for stamp_ns in sorted(self._odometry):
            newest_ns = (max(self._inputs.get(name, ()), default=-1) for name in due(stamp_ns))
            if len(self._odometry) <= _MAX_WAITING and any(each < stamp_ns for each in newest_ns):
                return
            messages = {name: held[stamp_ns] for name, held in self._inputs.items() if stamp_ns in held}
            for held in self._inputs.values():
                for old_ns in [each for each in held if each <= stamp_ns]:
                    del held[old_ns]
            yield stamp_ns, self._odometry.pop(stamp_ns), messages
