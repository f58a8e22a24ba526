"""Parses YAML and JSON from elsewhere: limited in size, nesting and expansion, with ValueError as the only error."""

import json
import re
from pathlib import Path
from typing import Any

import yaml

from simbev_ros.foundation.errors import LimitError
from simbev_ros.foundation.files.limits import MAX_YAML_BYTES, MAX_YAML_DEPTH, MAX_YAML_NUMBER_CHARS, MAX_YAML_VALUES

_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # the same values, many times faster


_LIBYAML_DEPTH = "maximum nesting depth"
"""In the message of libyaml's own limit, which newer versions have; ours is lower."""
_TOO_DEEP = f"it is nested more than {MAX_YAML_DEPTH} deep"


def parse_json(text: str | bytes) -> Any:
    """Parse JSON.

    Raises:
        ValueError: It is not valid, or nested too deeply.
    """
    try:
        return json.loads(text)
    except RecursionError:
        raise LimitError("it is nested too deeply") from None


def parse_yaml(text: str | bytes) -> Any:
    """Parse a YAML document of plain values.

    Raises:
        ValueError: It is not valid, or exceeds a limit.
    """
    if len(text) > MAX_YAML_BYTES:
        raise LimitError(f"it is longer than {MAX_YAML_BYTES >> 20} MiB")
    try:
        _check(text)
        return yaml.load(text, Loader=_LOADER)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        if _LIBYAML_DEPTH in str(error) and mark is not None:  # its scanner is ahead of the events
            raise LimitError(f"line {mark.line + 1}: {_TOO_DEEP}") from None
        raise ValueError(" ".join(str(error).split())) from None
    except (AttributeError, TypeError, KeyError, OverflowError) as error:  # values that their tag does not allow
        raise ValueError(f"a value does not fit its tag: {error!r}") from None


def load_yaml(path: Path) -> Any:
    """Parse a YAML file as ``parse_yaml`` does.

    Raises:
        OSError: The file cannot be read.
        ValueError: It is not a regular file, or see ``parse_yaml``.
    """
    if path.exists() and not path.is_file():
        raise ValueError("it is not a file")  # opening a pipe may wait forever
    with path.open("rb") as file:
        return parse_yaml(file.read(MAX_YAML_BYTES + 1))


def _check(text: str | bytes) -> None:
    """Raise LimitError if a text exceeds a limit; looks at events only, in time and memory linear in the text."""
    counts = [0]  # values so far in the document and in each open list or mapping
    names: list[str | None] = []  # anchors of the open lists and mappings
    sizes: dict[str | None, int] = {}  # values of each anchored node
    for event in yaml.parse(text, Loader=_LOADER):
        if isinstance(event, yaml.CollectionStartEvent):
            counts.append(1)
            names.append(event.anchor)
            if len(names) > MAX_YAML_DEPTH:
                raise LimitError(f"{_place(event)}: {_TOO_DEEP}")
            continue
        if isinstance(event, yaml.CollectionEndEvent):
            size = counts.pop()
            sizes[names.pop()] = size
        elif isinstance(event, yaml.AliasEvent):
            if event.anchor in names:
                raise ValueError(f"{_place(event)}: an alias refers to what it is part of")
            size = sizes.get(event.anchor, 1)
        elif isinstance(event, yaml.ScalarEvent):
            size = sizes[event.anchor] = 1
            if len(event.value) > MAX_YAML_NUMBER_CHARS and _NUMBER.fullmatch(event.value):
                raise LimitError(f"{_place(event)}: a number has {len(event.value):,} characters")
        else:
            continue
        counts[-1] += size
        if counts[-1] > MAX_YAML_VALUES:
            raise LimitError(f"{_place(event)}: it has more than {MAX_YAML_VALUES:,} values")


def _place(event: yaml.Event) -> str:
    return f"line {event.start_mark.line + 1}" if event.start_mark else "a value"


_NUMBER = re.compile(r"[-+.:_0-9]+")
"""Numbers, also those to the base 60, and dates."""
