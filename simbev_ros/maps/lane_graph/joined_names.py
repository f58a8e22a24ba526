"""Names of which several may stand for one thing."""

from collections.abc import Callable


class JoinedNames:
    """Names as a union-find structure: several names become one when they are joined."""

    def __init__(self, order: Callable[[str], object] = str) -> None:
        self._parent: dict[str, str] = {}
        self._order = order

    def resolve(self, name: str) -> str:
        """The name that stands for all that a name is joined with: the first one in order."""
        while (parent := self._parent.get(name, name)) != name:
            name = parent
        return name

    def join(self, one: str, other: str) -> None:
        """Join two names to one."""
        first, second = sorted((self.resolve(one), self.resolve(other)), key=self._order)  # type: ignore[arg-type]
        if first != second:
            self._parent[second] = first
