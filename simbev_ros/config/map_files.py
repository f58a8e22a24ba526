"""Files of maps that a configuration can name instead of a town: their types, their paths, and parts of them."""

import hashlib
import re
from itertools import product
from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator

from simbev_ros.foundation.errors import InputError

_PLAIN_SUFFIXES = (".xodr", ".osm", ".osm.xml", ".net.xml")
_COMPRESSIONS = (".gz", ".bz2", ".zst")
MAP_SUFFIXES = (*map("".join, product(_PLAIN_SUFFIXES, ("", *_COMPRESSIONS))), ".osm.pbf", ".pbf")
"""Suffixes of OpenDRIVE, OpenStreetMap or Lanelet2 (two) and SUMO net files, plain or compressed, and of PBF."""

READ_FILES = f"{', '.join(_PLAIN_SUFFIXES)}, each also compressed ({', '.join(_COMPRESSIONS)}), or .osm.pbf"
"""The suffixes in words, for messages."""


_MAX_NAME_CHARS = 48


def _check_bounds(bounds: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
    west, south, east, north = bounds
    if not (abs(west) <= 180 and abs(east) <= 180 and -90 <= south < north <= 90 and west != east):
        raise ValueError("must be west, south, east, north in degrees, with south below north")
    return bounds


Bounds = Annotated[tuple[float, float, float, float], AfterValidator(_check_bounds)]
"""Part of Earth between longitudes and latitudes: west, south, east, north in degrees; if west is above east, it
crosses the antimeridian, as in GeoJSON (RFC 7946)."""


def suffix_of(name_or_path: str) -> str:
    """The one of ``MAP_SUFFIXES`` that a name ends with; empty if there is none."""
    return max((suffix for suffix in MAP_SUFFIXES if name_or_path.lower().endswith(suffix)), key=len, default="")


def map_name(name_or_path: str, bounds: tuple[float, float, float, float] | None = None) -> str:
    """Name of a map: that of a town, or of a file without its suffix, in characters for file and topic names.

    The name of a part of a file ends in a digest of its bounds.
    """
    suffix = suffix_of(name_or_path)
    if not suffix:
        return name_or_path
    stem = Path(name_or_path).name[: -len(suffix)]
    name = re.sub(r"[^A-Za-z0-9_-]+", "_", stem)[:_MAX_NAME_CHARS].strip("_-") or "map"
    return name if bounds is None else f"{name}-{hashlib.sha256(repr(bounds).encode()).hexdigest()[:6]}"


def parse_bounds(text: str) -> tuple[float, float, float, float]:
    """Bounds that are written as ``W,S,E,N``.

    Raises:
        InputError: They are not such a text, or no possible bounds.
    """
    try:
        west, south, east, north = map(float, text.split(","))
        return _check_bounds((west, south, east, north))
    except ValueError:
        raise InputError(
            f"is {text!r:.80}; must be west,south,east,north in degrees, with south below north", parameter="bounds"
        ) from None


def expand_home(name: str) -> Path:
    """The path of a file as users write it, with ``~`` for a home folder.

    Raises:
        InputError: There is no such user.
    """
    try:
        return Path(name).expanduser()
    except RuntimeError:
        raise InputError(f"{name}: there is no such home folder") from None
