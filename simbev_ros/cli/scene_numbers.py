"""Scene numbers as they are written on the command line: ``3,17-20``."""

import re
from collections.abc import Iterable

from simbev_ros.foundation.errors import InputError

_RANGE = re.compile(r"([0-9]{1,18})(?:-([0-9]{1,18}))?")


def scene_numbers(option: str, words: Iterable[str]) -> list[range]:
    """Parse numbers and inclusive ranges, separated by commas or blanks.

    Raises:
        InputError: A word is neither a number nor a range.
    """
    numbers = []
    for part in (part.strip() for word in words for part in re.split(r"[,\s]+", word.strip())):
        match = _RANGE.fullmatch(part)
        first, last = (int(match[1]), int(match[2] or match[1])) if match else (1, 0)
        if last < first:
            raise InputError(f"{option}: {part!r} is neither a scene's number, such as 3, nor a range, such as 17-20")
        numbers.append(range(first, last + 1))
    return numbers
