"""Reads attributes of XML elements as numbers and identifiers."""

import math
import re
from typing import NoReturn
from xml.etree.ElementTree import Element

from simbev_ros.maps.findings import Findings
from simbev_ros.maps.opendrive.reading.tables import NUMBERS

MAX_ABS = 1e9
_LEADING_NUMBER = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)")
_LEADING_INTEGER = re.compile(r"\s*([+-]?\d{1,9})")


class Malformed(ValueError):
    """Raised for an element that cannot be used; the message names the attribute and what is allowed."""

    def __init__(self, element: Element, problem: str) -> None:
        super().__init__(f"<{element.tag}>: {problem}")
        self.element = element


def keep_leading_numbers(root: Element, notes: Findings) -> None:
    """Cut numbers off before characters that belong to none, as CARLA reads them: ``0.000000+0`` is 0."""
    for element in root.iter():
        for name in NUMBERS.intersection(element.attrib):
            text = element.attrib[name]
            try:
                float(text)
            except ValueError:
                match = _LEADING_NUMBER.match(text)
                if match is not None:
                    element.set(name, match[1])
                    rule = "a number is read up to the first character that belongs to none"
                    notes.repaired(rule, element, f"<{element.tag}>: {name}={text[:40]!r}")


def start_of(element: Element, name: str, notes: Findings, is_optional: bool = False) -> float:
    """The attribute at which a record starts; 0, with a note, if it cannot be read or is missing, as CARLA reads it."""
    try:
        return number(element, name, 0.0 if is_optional else None)
    except Malformed as problem:
        notes.repaired("a record without a readable start begins at 0", element, str(problem))
        return 0.0


def number(element: Element, name: str, default: float | None = None, max_abs: float = MAX_ABS) -> float:
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
        _refuse(element, f"{name}={text[:40]!r} is not a finite number of at most {max_abs:g}")
    return value


def identifier(element: Element) -> str:
    """The attribute ``id`` as a non-empty string.

    Raises:
        Malformed: It is missing or empty.
    """
    return element.get("id") or _refuse(element, "attribute 'id' is missing")


def integer_id(element: Element) -> int:
    """The attribute ``id`` as a whole number; further characters, as in ``-1.0``, are ignored.

    Raises:
        Malformed: It is missing or not a whole number.
    """
    text = identifier(element)
    match = _LEADING_INTEGER.match(text)
    return _refuse(element, f"id={text[:40]!r} is not a whole number") if match is None else int(match[1])


def _refuse(element: Element, problem: str) -> NoReturn:
    raise Malformed(element, problem)
