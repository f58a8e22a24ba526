"""Files of maps that a configuration can name instead of a town: their types and their paths."""

from pathlib import Path

from simbev_ros.errors import InputError

MAP_SUFFIXES = (".xodr", ".osm", ".osm.xml", ".net.xml")
"""Suffixes of OpenDRIVE, OpenStreetMap or Lanelet2 (two), and SUMO net files."""


def expand_home(name: str) -> Path:
    """The path of a file as users write it, with ``~`` for a home folder.

    Raises:
        InputError: There is no such user.
    """
    try:
        return Path(name).expanduser()
    except RuntimeError:
        raise InputError(f"{name}: there is no such home folder") from None
