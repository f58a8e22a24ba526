"""The base of all configuration models: frozen; unknown keys, NaN and infinity are refused."""

import difflib
from collections.abc import Iterable, Sequence
from typing import Any

from pydantic import BaseModel, ConfigDict, ValidationError

_VALUE_CHARS = 80
_WITHOUT_VALUE = ("missing", "json_invalid", "extra_forbidden", "value_error")
"""Kinds of errors with the value in their message, or that do not concern a single value."""


class Model(BaseModel):
    """Base of every configuration model."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    def __eq__(self, other: object) -> bool:
        """Whether all fields are equal; arrays that properties have cached do not count."""
        return type(self) is type(other) and all(
            getattr(self, name) == getattr(other, name) for name in type(self).model_fields
        )


Keys = tuple[str | int, ...]
"""Keys and indices that lead from a model, or from the top of a file, to a field."""


class FieldError(ValueError):
    """A field contradicts another one, which only the validator of a model above both can see.

    Args:
        keys: Path from that model to the field.
        problem: The message.
    """

    def __init__(self, keys: Sequence[str | int], problem: str) -> None:
        super().__init__(f"{dotted_path(keys)}: {problem}")
        self.keys: Keys = tuple(keys)
        self.problem = problem


def dotted_path(keys: Sequence[str | int]) -> str:
    """Keys and indices as messages show them: ``agents[1].spawn``."""
    return "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in keys).removeprefix(".")


def first_problem(error: Exception) -> str:
    """The first error of a validation as one line: field, requirement, and the value if there is one."""
    if not isinstance(error, ValidationError):
        return repr(error)
    entry = error.errors()[0]
    field = ".".join(map(str, entry["loc"]))
    message = entry["msg"].removeprefix("Value error, ")
    if entry["type"] not in _WITHOUT_VALUE:
        message = f"{message}, not {short_repr(entry['input'])}"
    return f"{field}: {message}" if field else message


def meant(word: object, allowed: Iterable[str]) -> str:
    """The beginning of ``; did you mean camera? allowed: …`` if one of the allowed words is close, else of the rest."""
    close = difflib.get_close_matches(str(word), list(allowed), n=1, cutoff=0.5)
    return f"; did you mean {close[0]}?" if close else ";"


def short_repr(value: Any) -> str:
    """The ``repr`` of a value, cut if it is long."""
    text = repr(value)
    return text if len(text) <= _VALUE_CHARS else f"{text[: _VALUE_CHARS - 3]}…"
