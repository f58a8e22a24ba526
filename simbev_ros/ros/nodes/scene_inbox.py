"""Passes on the scenes that the supervisor has requested, and no others that are published on /world/scene."""

from collections.abc import Callable
from typing import Generic, TypeVar

_MAX_WAITING = 8

_Message = TypeVar("_Message")


class SceneInbox(Generic[_Message]):
    """Joins announced scenes with signed requests, which may arrive in any order.

    Args:
        deliver: Called with specification and message of every scene that is announced and requested.
    """

    def __init__(self, deliver: Callable[[str, _Message], None]) -> None:
        self._deliver = deliver
        self._requested: str | None = None
        self._waiting: dict[str, _Message] = {}

    def announce(self, specification: str, message: _Message) -> None:
        """Take a message from /world/scene with the JSON of its specification."""
        self._waiting.pop(specification, None)
        self._waiting[specification] = message
        while len(self._waiting) > _MAX_WAITING:
            del self._waiting[next(iter(self._waiting))]
        self._match()

    def request(self, specification: str) -> None:
        """Take the specification of the scene that the supervisor has asked for last."""
        self._requested = specification
        self._match()

    def _match(self) -> None:
        if self._requested is not None and (message := self._waiting.pop(self._requested, None)) is not None:
            self._deliver(self._requested, message)
