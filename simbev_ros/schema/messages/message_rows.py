"""Rows and constants of this project's messages, as numpy types and numbers.

``interfaces/msg/*.msg`` is the only place with a table's columns, their units and their meaning. Its lines are parsed
here and not by rosbags, because all that reads or makes a table imports this, and rosbags' type stores load slowly.
"""

from functools import cache, lru_cache

import numpy as np

from simbev_ros.foundation.installation.interface_files import OWN_PACKAGE, interface_files

_KINDS = {f"{kind}{bits}": f"<{kind[0]}{bits // 8}" for kind in ("float", "int", "uint") for bits in (8, 16, 32, 64)}
_COLUMN_OF_FIELD = {"class_id": "class"}
"""Columns that are called otherwise than their fields, because their names are words of C++ and Python."""


def message_fields(kind: str, package: str = OWN_PACKAGE) -> dict[str, str]:
    """Types of the fields of a package's message such as ``Box``, by name, in order.

    Raises:
        FileNotFoundError: The installation is incomplete.
        KeyError: There is no such message.
    """
    return {name: type_name for type_name, name, value in _declarations(kind, package) if value is None}


def message_constants(kind: str) -> dict[str, int]:
    """Whole-number constants of a message such as ``Box``, by name.

    Raises:
        FileNotFoundError: The installation is incomplete.
        KeyError: There is no such message.
    """
    return {
        name: int(value) for type_name, name, value in _declarations(kind, OWN_PACKAGE) if value and type_name in _KINDS
    }


@cache
def row_dtype(kind: str, package: str = OWN_PACKAGE) -> np.dtype[np.void]:
    """Type of the rows of a table with the fields of a message as columns, packed.

    Args:
        kind: Name of a message with only numbers as fields, such as ``Box``.
        package: Package of the message, one whose definitions come with this one.

    Raises:
        FileNotFoundError: The installation is incomplete.
        KeyError: There is no such message.
    """
    fields = message_fields(kind, package)
    return np.dtype([(_COLUMN_OF_FIELD.get(name, name), _KINDS[each]) for name, each in fields.items()])


@lru_cache
def _declarations(kind: str, package: str) -> list[tuple[str, str, str | None]]:
    """Type and name of each field and constant of a message in order, and the value if it is a constant."""
    found: list[tuple[str, str, str | None]] = []
    for line in interface_files(package)[f"{package}/msg/{kind}"].read_text(encoding="utf-8").splitlines():
        if words := line.partition("#")[0].split():
            name, _, value = words[1].partition("=")
            found.append((words[0], name, value or None))
    return found
