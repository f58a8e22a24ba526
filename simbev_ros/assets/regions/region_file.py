"""A region's scene as flat arrays in one file, and back."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from simbev_ros.assets.land.plazas import plaza_arrays, plazas_from
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.mesh.mesh_arrays import mesh_arrays, meshes_from
from simbev_ros.assets.placement.static_scene import StreetLight, Tile
from simbev_ros.assets.regions.region_scene import RegionScene, Streetside
from simbev_ros.types import AnyArray

_COARSE = "seen from afar"


def write_region(path: Path, scene: RegionScene) -> None:
    """Write a scene of at least one tile."""
    np.savez(path, allow_pickle=False, **dict(_arrays(scene)))


def read_region(path: Path) -> RegionScene:
    """Read it again, the same to the byte.

    Raises:
        One of ``errors.NPZ_DAMAGE``: The file is damaged.
    """
    with path.open("rb") as stream, np.load(stream, allow_pickle=False) as arrays:
        meshes = meshes_from(arrays)
        origins_m, levels, lights_m = arrays["origin_m"], arrays["level"].tolist(), arrays["street_light_m"]
        details = arrays["detail"].tolist()
        obstacles, plazas = arrays["obstacle"], plazas_from(arrays)
        owners = list(zip(arrays["tile"].tolist(), arrays["name"].tolist(), strict=True))
    by_tile: list[dict[str, Mesh]] = [{} for _ in origins_m]
    for (row, name), mesh in zip(owners, meshes, strict=True):
        by_tile[row][name] = mesh
    tiles = zip(origins_m, by_tile, levels, details, strict=True)
    return RegionScene(
        tuple(
            Tile(origin_m, named.pop(""), named, level, named.pop(_COARSE), detail)
            for origin_m, named, level, detail in tiles
        ),
        tuple(StreetLight((x, y, z)) for x, y, z in lights_m.tolist()),
        obstacles,
        plazas,
    )


def read_streetside(path: Path) -> Streetside:
    """A region's part of it, without reading the rest; raises as ``read_region``."""
    with path.open("rb") as stream, np.load(stream, allow_pickle=False) as arrays:
        return Streetside(arrays["street_light_m"], arrays["obstacle"], plazas_from(arrays))


def _arrays(scene: RegionScene) -> Iterator[tuple[str, AnyArray]]:
    """All meshes end to end, and where each one belongs."""
    meshes = [(row, name, mesh) for row, tile in enumerate(scene.tiles) for name, mesh in _named(tile)]
    yield "origin_m", np.array([tile.origin_m for tile in scene.tiles])
    yield "level", np.array([tile.level for tile in scene.tiles])
    yield "detail", np.array([tile.detail for tile in scene.tiles])
    yield "street_light_m", np.array([light.position_m for light in scene.street_lights]).reshape(-1, 3)
    yield "obstacle", scene.obstacles
    yield from plaza_arrays(scene.plazas)
    yield "tile", np.array([row for row, _, _ in meshes])
    yield "name", np.array([name for _, name, _ in meshes])
    yield from mesh_arrays([mesh for _, _, mesh in meshes])


def _named(tile: Tile) -> Iterator[tuple[str, Mesh]]:
    """What is seen, without a name, what stands for it from afar, then the surfaces."""
    yield "", tile.mesh
    yield _COARSE, tile.coarse
    yield from tile.surfaces.items()
