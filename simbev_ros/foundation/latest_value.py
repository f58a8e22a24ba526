"""A cache of one value, for what is large and needed several times in a row, such as the roads of a map."""

from collections.abc import Callable
from typing import Generic, TypeVar

K = TypeVar("K")
V = TypeVar("V")


class LatestValue(Generic[K, V]):
    """Keeps the value of the latest key; for one thread."""

    def __init__(self) -> None:
        self._kept: tuple[K, V] | None = None

    def get(self, key: K, make: Callable[[], V]) -> V:
        """Return the value of a key; it is made unless the latest call had an equal key."""
        if self._kept is None or self._kept[0] != key:
            self._kept = key, make()
        return self._kept[1]
