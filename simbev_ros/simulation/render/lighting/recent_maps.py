"""The maps of the static world that a renderer keeps for the agents whose images it draws in turn."""

from collections.abc import Callable, Hashable
from typing import Generic, TypeVar

_Key = TypeVar("_Key", bound=Hashable)
_Map = TypeVar("_Map")


class RecentMaps(Generic[_Key, _Map]):
    """Maps by the key that determines their content. When there are enough of them, the least recently used is reused.

    With one map for each agent, and agents that take turns, this is the map that the same agent used last.

    Args:
        create: Allocates a map.

    Attributes:
        max_count: Number of maps from which on one is reused; less than 1 counts as 1.
    """

    def __init__(self, create: Callable[[], _Map]) -> None:
        self.max_count = 1
        self._create = create
        self._maps: dict[_Key, _Map] = {}  # in the order of their last use

    def find(self, key: _Key) -> tuple[_Map, _Key | None]:
        """Find the map for a key; the caller draws into it what differs from the key for which it was drawn.

        Returns:
            The map, and the key for which it was drawn; None: it is new.
        """
        drawn: _Key | None = key if key in self._maps else None
        if drawn is None and len(self._maps) >= max(self.max_count, 1):
            drawn = next(iter(self._maps))
        found = self._create() if drawn is None else self._maps.pop(drawn)
        self._maps[key] = found
        return found, drawn
