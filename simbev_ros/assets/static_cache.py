"""Static scenes on demand: built once per map, then read from a file."""

import hashlib
import os
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import fields
from functools import lru_cache
from importlib.resources import files
from pathlib import Path

import numpy as np

from simbev_ros.assets.build import build_static_scene
from simbev_ros.assets.mesh import Mesh
from simbev_ros.assets.static_scene import StaticScene, StreetLight, Tile
from simbev_ros.errors import InputError
from simbev_ros.maps.build import default_cache_dir
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.recipe import recipe_of
from simbev_ros.maps.spec import MapSpec
from simbev_ros.types import AnyArray

_PACKAGES = ("assets", "maps", "geometry", "scene", "config")


def load_static_scene(spec: MapSpec, network: RoadNetwork, cache_dir: Path | None = None) -> StaticScene:
    """The static scene of a map; a cached one has the same bytes as one built anew.

    Args:
        spec: The map and the seed of its surroundings.
        network: Its roads.
        cache_dir: Where scenes that were built once are kept; ``default_cache_dir()`` when omitted.

    Raises:
        InputError: No map has this name, or the cache cannot be written.
        SimbevError: The roads are not level.
    """
    folder = (cache_dir or default_cache_dir()) / "surroundings"
    path = folder / f"{spec.name}-{_key(spec, network)}.npz"
    if path.is_file():
        return _read(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        scene = build_static_scene(network, recipe_of(spec.name).surroundings, spec.seed)
        _write(path, scene)
    except OSError as error:
        raise InputError(f"cache of surroundings {folder}: cannot be written: {error.strerror}") from error
    return scene


def _key(spec: MapSpec, network: RoadNetwork) -> str:
    """Hash of all that a static scene depends on: map, roads, the code and tables that build it."""
    content = hashlib.sha256()
    content.update(spec.model_dump_json().encode())
    content.update(recipe_of(spec.name).model_dump_json().encode())
    content.update(network.net_path.read_bytes())
    content.update(_code_version())
    return content.hexdigest()[:20]


@lru_cache(maxsize=1)
def _code_version() -> bytes:
    """Hash of the sources that build static scenes."""
    content = hashlib.sha256(np.__version__.encode())
    for package in _PACKAGES:
        for entry in sorted(files(f"simbev_ros.{package}").iterdir(), key=lambda entry: entry.name):
            if entry.name.endswith((".py", ".yaml")):
                content.update(entry.name.encode() + entry.read_bytes())
    return content.digest()


def _write(path: Path, scene: StaticScene) -> None:
    """Write under another name, then rename: readers see all or nothing, and of several writers the last one wins."""
    descriptor, name = tempfile.mkstemp(prefix=f".{path.stem}-", dir=path.parent)
    try:
        with os.fdopen(descriptor, "wb") as stream:
            np.savez(stream, allow_pickle=False, **dict(_arrays(scene)))
        Path(name).replace(path)
    finally:
        Path(name).unlink(missing_ok=True)


def _arrays(scene: StaticScene) -> Iterator[tuple[str, AnyArray]]:
    """All meshes end to end, and where each one belongs."""
    meshes = [(row, name, mesh) for row, tile in enumerate(scene.tiles) for name, mesh in _named(tile)]
    yield "origin_m", np.array([tile.origin_m for tile in scene.tiles])
    yield "street_light_m", np.array([light.position_m for light in scene.street_lights]).reshape(-1, 3)
    yield "tile", np.array([row for row, _, _ in meshes])
    yield "name", np.array([name for _, name, _ in meshes])
    for field in fields(Mesh):
        columns = [getattr(mesh, field.name) for _, _, mesh in meshes]
        yield field.name, np.concatenate(columns)
        yield f"{field.name}_count", np.array([len(column) for column in columns])


def _named(tile: Tile) -> Iterator[tuple[str, Mesh]]:
    """What is seen, without a name, then the surfaces."""
    yield "", tile.mesh
    yield from tile.surfaces.items()


def _read(path: Path) -> StaticScene:
    with np.load(path, allow_pickle=False) as arrays:
        columns = {field.name: _split(arrays, field.name) for field in fields(Mesh)}
        origins_m, lights_m = arrays["origin_m"], arrays["street_light_m"]
        owners = list(zip(arrays["tile"].tolist(), arrays["name"].tolist(), strict=True))
    by_tile: list[dict[str, Mesh]] = [{} for _ in origins_m]
    for index, (row, name) in enumerate(owners):
        by_tile[row][name] = Mesh(**{field: column[index] for field, column in columns.items()})
    return StaticScene(
        tuple(Tile(origin_m, meshes.pop(""), meshes) for origin_m, meshes in zip(origins_m, by_tile, strict=True)),
        tuple(StreetLight((x, y, z)) for x, y, z in lights_m.tolist()),
    )


def _split(arrays: Mapping[str, AnyArray], name: str) -> list[AnyArray]:
    return np.split(arrays[name], np.cumsum(arrays[f"{name}_count"])[:-1])
