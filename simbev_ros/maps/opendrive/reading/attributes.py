"""Reads attributes of XML elements as numbers and identifiers, and collects notes about invalid ones."""

import math
from pathlib import Path
from typing import NoReturn
from xml.etree.ElementTree import Element

from simbev_ros.maps.safe_xml import place_of

_MAX_ABS = 1e9


class Malformed(ValueError):
    """Raised for an element that cannot be used; the message names the attribute and what is allowed."""

    def __init__(self, element: Element, problem: str) -> None:
        super().__init__(f"<{element.tag}>: {problem}")
        self.element = element


class Notes:
    """Collects repairs and omissions, each kind once, with its first location and the number of occurrences."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._first: dict[str, str] = {}
        self._count: dict[str, int] = {}

    def add(self, kind: str, element: Element | None = None, detail: str = "") -> None:
        """Record one repair of a ``kind``; ``detail`` may differ between occurrences."""
        if kind not in self._count:
            location = self._path.name if element is None else place_of(Path(self._path.name), element)
            self._first[kind] = f"{location}: {kind}" + (f" ({detail})" if detail else "")
        self._count[kind] = self._count.get(kind, 0) + 1

    def sentences(self) -> tuple[str, ...]:
        """One sentence per kind of repair."""
        return tuple(
            text if self._count[kind] == 1 else f"{text}, and {self._count[kind] - 1} more of the kind"
            for kind, text in self._first.items()
        )


def number(element: Element, name: str, default: float | None = None, max_abs: float = _MAX_ABS) -> float:
    """The attribute as a finite number.

    Raises:
        Malformed: It is missing without a default, or is not a finite number of at most ``max_abs``.
    """
    text = element.get(name)
    if text is None:
        return default if default is not None else _refuse(element, f"attribute {name!r} is missing")
    try:
        value = float(text)
    except ValueError:
        _refuse(element, f"{name}={text[:40]!r} is not a number")
    if not math.isfinite(value) or abs(value) > max_abs:
        _refuse(element, f"{name}={text[:40]!r} is not a finite number of at most 1e{math.log10(max_abs):.0f}")
    return value


def identifier(element: Element) -> str:
    """The attribute ``id`` as a non-empty string.

    Raises:
        Malformed: It is missing or empty.
    """
    return element.get("id") or _refuse(element, "attribute 'id' is missing")


def integer_id(element: Element) -> int:
    """The attribute ``id`` as a whole number.

    Raises:
        Malformed: It is missing or not a whole number.
    """
    text = identifier(element)
    try:
        return int(text)
    except ValueError:
        _refuse(element, f"id={text[:40]!r} is not a whole number")


def _refuse(element: Element, problem: str) -> NoReturn:
    raise Malformed(element, problem)
