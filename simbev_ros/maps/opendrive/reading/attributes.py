"""Reads attributes of XML elements as numbers and identifiers."""

import math
from typing import NoReturn
from xml.etree.ElementTree import Element

_MAX_ABS = 1e9


class Malformed(ValueError):
    """Raised for an element that cannot be used; the message names the attribute and what is allowed."""

    def __init__(self, element: Element, problem: str) -> None:
        super().__init__(f"<{element.tag}>: {problem}")
        self.element = element


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
