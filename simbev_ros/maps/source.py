"""From what a user calls a map, a town's name or a file, to a MapSpec; and from there back to the unchanged file."""

import hashlib
import re
from pathlib import Path

from simbev_ros.config.map_files import MAP_SUFFIXES
from simbev_ros.errors import InputError
from simbev_ros.maps.recipe import known_maps
from simbev_ros.maps.safe_xml import check_readable
from simbev_ros.maps.spec import MapSpec

_MAX_NAME = 48


def map_spec(name_or_path: str, seed: int = 0) -> MapSpec:
    """The map that is meant by a town's name, or by the path of a file.

    Raises:
        InputError: There is no such town or file, or the file cannot be read or is too large.
    """
    suffix = suffix_of(name_or_path)
    if suffix:
        path = Path(name_or_path).expanduser().resolve()
        return MapSpec(name=_file_name(path, suffix), seed=seed, path=str(path), sha256=_sha256(path))
    if name_or_path in known_maps():
        return MapSpec(name=name_or_path, seed=seed)
    raise InputError(
        f"map: no map is called {name_or_path!r}; towns: {', '.join(known_maps())}; "
        f"files end in {', '.join(MAP_SUFFIXES)}"
    )


def suffix_of(name_or_path: str) -> str:
    """Which of ``MAP_SUFFIXES`` a file has; empty if it has none of them."""
    return next((suffix for suffix in MAP_SUFFIXES if name_or_path.lower().endswith(suffix)), "")


def file_of(spec: MapSpec) -> Path:
    """The file of a map that is a file.

    Raises:
        InputError: It is gone, or another one than when the map was chosen.
    """
    path = Path(spec.path)
    if _sha256(path) != spec.sha256:
        raise InputError(
            f"{path}: has changed since the scene was drawn (SHA-256 then {spec.sha256[:12]}…); "
            "put the file of that time there, or draw the scene again"
        )
    return path


def _sha256(path: Path) -> str:
    check_readable(path)
    try:
        with path.open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None


def _file_name(path: Path, suffix: str) -> str:
    """The file's name without suffix, of characters that are safe in the names of files and topics."""
    return re.sub(r"[^A-Za-z0-9_-]+", "_", path.name[: -len(suffix)])[:_MAX_NAME].strip("_-") or "map"
