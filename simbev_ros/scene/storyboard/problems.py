"""Problems of a scenario's files, which are reported together."""

from collections.abc import Collection, Iterator
from contextlib import contextmanager
from itertools import islice

from simbev_ros.config.base import meant
from simbev_ros.foundation.errors import InputError

_MAX_PROBLEMS = 50
"""Number of problems that are explained."""

_MAX_NOTES = 200
_MAX_LISTED = 50
_MAX_CHARS = 80


def listed(word: str, known: Collection[str], head: str = "allowed") -> str:
    """The end of a message about a word that is not known: the one that may be meant, and all that there are."""
    names = [name[:_MAX_CHARS] for name in islice(known, _MAX_LISTED)]
    more = ", …" if len(known) > len(names) else ""
    return f"{meant(word[:_MAX_CHARS], names)} {head}: {', '.join(names) or 'none'}{more}"


class Problems(dict[tuple[str, int, str], str]):
    """The problems of a scenario by file, line and subject, such as an attribute, which has only one."""

    def __init__(self) -> None:
        super().__init__()
        self._notes = 0

    def add(self, place: str, problem: str, subject: str = "") -> None:
        """Note a problem at a place, ``file:line``; raises the InputError of ``raise_any`` if there are very many."""
        file, _, line = place.rpartition(":")
        self.setdefault((file, int(line), subject or problem), f"{place}: {subject} {problem}".replace(":  ", ": "))
        self._notes += 1
        if self._notes > _MAX_NOTES:
            self.raise_any()

    @contextmanager
    def noted(self, place: str, subject: str) -> Iterator[None]:
        """Note the ValueError that the block may raise."""
        try:
            yield
        except ValueError as error:
            self.add(place, str(error), subject)

    def raise_any(self) -> None:
        """Raise one InputError with all problems, one a line in their order in the files, if there are any."""
        lines = [line for _, line in sorted(self.items())]
        if len(lines) > _MAX_PROBLEMS:
            lines[_MAX_PROBLEMS:] = [f"and {len(lines) - _MAX_PROBLEMS:,} more problems"]
        if lines:
            raise InputError("\n".join(lines))
