"""Attributes of XML elements as numbers and identifiers, and what is wrong with them."""

import math
from pathlib import Path
from typing import NoReturn
from xml.etree.ElementTree import Element

from simbev_ros.maps.safe_xml import place_of

_LARGEST = 1e9


class Malformed(ValueError):
    """An element that cannot be used; the message names the attribute and what is allowed."""

    def __init__(self, element: Element, problem: str) -> None:
        super().__init__(f"<{element.tag}>: {problem}")
        self.element = element


class Notes:
    """What was repaired or left out: each kind once, with the first place and how many there are."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._first: dict[str, str] = {}
        self._count: dict[str, int] = {}

    def add(self, what: str, element: Element | None = None, detail: str = "") -> None:
        """Remember one repair; ``what`` is the kind, ``detail`` differs from case to case."""
        if what not in self._count:
            place = self._path.name if element is None else place_of(Path(self._path.name), element)
            self._first[what] = f"{place}: {what}" + (f" ({detail})" if detail else "")
        self._count[what] = self._count.get(what, 0) + 1

    def sentences(self) -> tuple[str, ...]:
        """One sentence for each kind."""
        return tuple(
            text if self._count[what] == 1 else f"{text}, and {self._count[what] - 1} more of the kind"
            for what, text in self._first.items()
        )


def number(element: Element, name: str, default: float | None = None) -> float:
    """A finite number.

    Raises:
        Malformed: It is missing without a default, or is not a finite number of at most 1e9.
    """
    text = element.get(name)
    if text is None:
        return default if default is not None else _refuse(element, f"attribute {name!r} is missing")
    try:
        value = float(text)
    except ValueError:
        _refuse(element, f"{name}={text[:40]!r} is not a number")
    if not math.isfinite(value) or abs(value) > _LARGEST:
        _refuse(element, f"{name}={text[:40]!r} is not a finite number of at most 1e9")
    return value


def positive(element: Element, name: str) -> float:
    """A number above zero.

    Raises:
        Malformed: It is not.
    """
    value = number(element, name)
    return value if value > 0.0 else _refuse(element, f"{name}={value:g} must be above 0")


def identifier(element: Element, name: str = "id") -> str:
    """A string that is there and not empty.

    Raises:
        Malformed: It is not.
    """
    return element.get(name) or _refuse(element, f"attribute {name!r} is missing")


def integer(element: Element, name: str = "id") -> int:
    """A whole number.

    Raises:
        Malformed: It is not.
    """
    text = identifier(element, name)
    try:
        return int(text)
    except ValueError:
        _refuse(element, f"{name}={text[:40]!r} is not a whole number")


def _refuse(element: Element, problem: str) -> NoReturn:
    raise Malformed(element, problem)
