"""Finds the libraries of the system that the simulator's wheels need and that this machine lacks."""

import ctypes
from typing import NamedTuple

from simbev_ros.foundation.tables import load_table


class SystemLibrary(NamedTuple):
    """A library that comes from the system.

    Attributes:
        name: As in DT_NEEDED, or as opened at run time.
        package: Its Debian package.
    """

    name: str
    package: str


def load_packages() -> dict[str, dict[str, str]]:
    """Load the table of packages: ``linked`` and ``opened``, each library → Debian package."""
    return load_table("simbev_ros.foundation.installation", "system_libraries.yaml")


def find_missing_libraries() -> list[SystemLibrary]:
    """Libraries of the table that the dynamic loader does not find on this machine."""
    known = (SystemLibrary(name, package) for table in load_packages().values() for name, package in table.items())
    # Mesa's drivers, which are named with their folder, are on no search path of the loader.
    return [library for library in known if "/" not in library.name and not _is_found(library.name)]


def _is_found(name: str) -> bool:
    try:
        ctypes.CDLL(name)
    except OSError as error:
        return "cannot open shared object file" not in str(error)  # else it is there, but cannot be loaded
    return True
