"""Resolves the name of a town or the path of a map file to a MapSpec, and a MapSpec to its unchanged file."""

import hashlib
import os
from functools import lru_cache
from importlib.resources import files
from pathlib import Path

from simbev_ros.config.base import meant
from simbev_ros.config.map_files import READ_FILES, Bounds, expand_home, map_name, suffix_of
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.files.limits import MAX_MAP_BYTES, MAX_OSM_BYTES, MAX_PBF_BYTES
from simbev_ros.maps.safe_xml import check_readable
from simbev_ros.schema.scene.map_spec import MapSpec

MAP_FILES_VARIABLE = "SIMBEV_MAP_FILES"
"""Environment variable with the folder for copies of map files, on machines that do not have them at their paths."""


def known_maps() -> tuple[str, ...]:
    """Names of all built-in maps, sorted."""
    towns = files("simbev_ros.maps").joinpath("towns")
    return tuple(sorted(entry.name.removesuffix(".yaml") for entry in towns.iterdir() if entry.name.endswith(".yaml")))


def map_spec(name_or_path: str, seed: int = 0, bounds: Bounds | None = None) -> MapSpec:
    """The MapSpec for the name of a town or the path of a map file.

    Args:
        name_or_path: The town or file.
        seed: Random seed for everything that the map does not prescribe.
        bounds: Part of an OpenStreetMap file; its name then ends in a digest of the bounds.

    Raises:
        InputError: There is no such town or file, it has no parts, or the file cannot be read or is too large.
    """
    suffix = suffix_of(name_or_path)
    if bounds is not None and not is_street_map(suffix):
        raise InputError(f"bounds: only OpenStreetMap files have parts that can be chosen, not {name_or_path}")
    if suffix:
        path = expand_home(name_or_path).resolve()
        _require_text(path)
        return MapSpec(name=map_name(path.name, bounds), seed=seed, path=str(path), sha256=_sha256(path), bounds=bounds)
    if name_or_path in known_maps():
        return MapSpec(name=name_or_path, seed=seed)
    if Path(name_or_path).suffix:
        raise InputError(f"{name_or_path}: is not a kind of map file that is read; read are {READ_FILES}")
    raise InputError(
        f"map: no map is called {name_or_path!r:.80}{meant(name_or_path, known_maps())} "
        f"towns: {', '.join(known_maps())}; map files end in {READ_FILES}"
    )


def known_map(name_or_path: str) -> str:
    """The given name of a town or path of a map file, after a check that there is such a map.

    Raises:
        InputError: There is no such town or file, or the file cannot be read or is too large.
    """
    map_spec(name_or_path)
    return name_or_path


def is_street_map(suffix: str) -> bool:
    """Whether a suffix of ``MAP_SUFFIXES`` is one of OpenStreetMap's."""
    return suffix.startswith((".osm", ".pbf"))


def file_of(spec: MapSpec) -> Path:
    """The file of an imported map, or its copy on this machine, verified against its recorded hash.

    Raises:
        InputError: The file is missing, or has changed since the map was chosen.
    """
    path = Path(spec.path)
    copy = Path(os.environ.get(MAP_FILES_VARIABLE, "")) / name_of_copy(spec)
    if MAP_FILES_VARIABLE in os.environ and not path.exists() and copy.is_file():
        path = copy
    if _sha256(path) != spec.sha256:
        raise InputError(
            f"{path}: has changed since the scene was drawn (SHA-256 then {spec.sha256[:12]}…); "
            "restore the original file, or draw the scene again"
        )
    return path


def name_of_copy(spec: MapSpec) -> str:
    """Name that the copy of a map file has in the folder for copies; it depends on the content alone."""
    return f"{spec.sha256}{suffix_of(spec.path)}"


def _require_text(path: Path) -> None:
    """Refuse a path that is not UTF-8, because scenes store it as text."""
    try:
        str(path).encode()
    except UnicodeEncodeError:
        raise InputError(f"{path}: the path of a map must be valid UTF-8") from None


def _sha256(path: Path) -> str:
    check_readable(path, _max_bytes(suffix_of(path.name)))
    status = path.stat()
    return _sha256_of(path, status.st_size, status.st_mtime_ns)


@lru_cache(maxsize=64)
def _sha256_of(path: Path, size_bytes: int, modified_ns: int) -> str:
    """SHA-256 of a file; files of whole countries are not read again while size and time stay the same."""
    try:
        with path.open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None


def _max_bytes(suffix: str) -> int:
    """Largest size of a map file on disk."""
    if suffix.endswith(".pbf"):
        return MAX_PBF_BYTES
    return MAX_OSM_BYTES if is_street_map(suffix) else MAX_MAP_BYTES
