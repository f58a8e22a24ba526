"""Values in scenarios: their types, the parameters that stand for them, and the constraints of these."""

import math
import operator
from collections.abc import Callable, Mapping, MutableMapping
from datetime import UTC, datetime
from typing import Any, NamedTuple
from xml.etree.ElementTree import Element

from simbev_ros.scene.storyboard.expressions import evaluate
from simbev_ros.scene.storyboard.problems import listed

Value = str | int | float | bool | datetime

RULES: Mapping[str, Callable[[Any, Any], bool]] = {
    "greaterThan": operator.gt,
    "lessThan": operator.lt,
    "equalTo": operator.eq,
    "greaterOrEqual": operator.ge,
    "lessOrEqual": operator.le,
    "notEqualTo": operator.ne,
}
"""The comparisons of conditions and constraints by their names."""

_FLAGS = {"true": True, "1": True, "false": False, "0": False}


_MAX_NUMBER = 1e12


def _number(text: str, lowest: float = -_MAX_NUMBER) -> float:
    if "_" in text or not lowest <= (value := float(text)) <= _MAX_NUMBER:
        raise ValueError
    return value


def _integer(text: str, lowest: int = -(2**31), highest: int = 2**31 - 1) -> int:
    if "_" in text or not lowest <= (value := int(text)) <= highest:
        raise ValueError
    return value


def _time(text: str) -> datetime:
    moment = datetime.fromisoformat(text)
    if not 1 < moment.year < 9000:  # hours are added to it
        raise ValueError
    return moment if moment.tzinfo else moment.replace(tzinfo=UTC)


_TYPES: Mapping[str, tuple[Callable[[str], Any], str]] = {
    "text": (str, "a text"),
    "number": (_number, f"a finite number of at most {_MAX_NUMBER:g}"),
    "amount": (lambda text: _number(text, 0), f"a finite number of at least 0 and at most {_MAX_NUMBER:g}"),
    "magnitude": (lambda text: abs(_number(text)), f"a finite number of at most {_MAX_NUMBER:g}"),
    "positive": (lambda text: _number(text, math.ulp(0.0)), f"a finite number above 0 and at most {_MAX_NUMBER:g}"),
    "integer": (_integer, "an integer of 32 bits"),
    "count": (lambda text: _integer(text, 0, 2**32 - 1), "an integer from 0 to 4294967295"),
    "short": (lambda text: _integer(text, 0, 2**16 - 1), "an integer from 0 to 65535"),
    "flag": (lambda text: _FLAGS[text], "true or false"),
    "time": (_time, "a date and time such as 2026-06-01T12:00:00"),
}
_DECLARED = {
    "string": "text",
    "double": "number",
    "boolean": "flag",
    "dateTime": "time",
    "int": "integer",
    "unsignedInt": "count",
    "unsignedShort": "short",
}
"""Types of parameters and variables by their names in declarations."""


def read_value(kind: str, text: str) -> Any:
    """The value of a text.

    Args:
        kind: A type of the table of elements, or of a declared parameter or variable. Times without a zone are UTC.
        text: The text.

    Raises:
        ValueError: The text is not of this type.
    """
    convert, words = _TYPES[_DECLARED.get(kind, kind)]
    try:
        return convert(text)
    except (ValueError, KeyError):
        raise ValueError(f"is {text!r:.80}; must be {words}") from None


def text_of(value: Value) -> str:
    """A value as files have it."""
    if isinstance(value, bool):
        return str(value).lower()
    return str(int(value)) if isinstance(value, float) and value.is_integer() and abs(value) < 2**53 else str(value)


class Parameter(NamedTuple):
    """A parameter as text and as value."""

    text: str
    value: Value


Scope = MutableMapping[str, Parameter]
"""The parameters that are valid in an element, by their names."""


def substitute(text: str, scope: Scope) -> str:
    """The text of an attribute in which a reference to a parameter, or an expression, is replaced by its value.

    Args:
        text: ``$name``, ``${expression}``, or a literal, in which a leading ``$`` follows a backslash.
        scope: The parameters that are valid here.

    Raises:
        ValueError: A parameter is not declared, or the expression is not valid.
    """
    if text.startswith("${") and text.endswith("}"):
        return text_of(evaluate(text[2:-1], lambda name: _named(name, scope).value))
    if text.startswith("$"):
        return _named(text[1:], scope).text
    return text[1:] if text.startswith("\\$") else text


def _named(name: str, scope: Scope) -> Parameter:
    if name not in scope:
        raise ValueError(f"uses the parameter {name:.80}, which is not declared{listed(name, scope, 'declared')}")
    return scope[name]


def read_declaration(declaration: Element, scope: Scope, given: str | float | None) -> Parameter:
    """The parameter of a declaration.

    Args:
        declaration: A ``ParameterDeclaration``.
        scope: The parameters that its value may refer to.
        given: A value in place of its own; a float is rounded for an integer.

    Raises:
        ValueError: Type or value are not valid, or the value violates the constraints.
    """
    kind = declaration.get("parameterType", "").replace("integer", "int")
    if kind not in _DECLARED:
        raise ValueError(f"has the type {kind!r:.80}{listed(kind, _DECLARED)}")
    if isinstance(given, float):
        given = text_of(round(given) if _DECLARED[kind] in ("integer", "count", "short") else given)
    text = substitute(declaration.get("value", ""), scope) if given is None else given
    value = read_value(kind, text)
    groups = [
        [(item.get("rule", ""), substitute(item.get("value", ""), scope)) for item in group]
        for group in declaration.findall("ConstraintGroup")
    ]
    if unknown := {rule for group in groups for rule, _ in group} - RULES.keys():
        raise ValueError(f"has the rule {min(unknown)!r:.80}{listed(min(unknown), RULES)}")
    if groups and not any(
        all(RULES[rule](value, read_value(kind, limit)) for rule, limit in group) for group in groups
    ):
        words = " or ".join(" and ".join(f"{rule} {limit}" for rule, limit in group) for group in groups)
        raise ValueError(f"is {text!r:.80}; must be {words:.200}")
    return Parameter(text, value)
