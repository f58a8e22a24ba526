"""Reads and writes the scene of one region as a file of flat arrays, which is mapped: processes share one copy."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from simbev_ros.assets.land.plazas import plaza_arrays, plazas_from
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.mesh.mesh_arrays import mesh_arrays, meshes_from
from simbev_ros.assets.placement.static_scene import StreetLight, Tile
from simbev_ros.assets.regions.region_scene import RegionScene, Streetside
from simbev_ros.foundation.files.mapped_arrays import map_arrays, write_arrays
from simbev_ros.foundation.types import AnyArray

_COARSE = "seen from afar"


def write_region(path: Path, scene: RegionScene) -> None:
    """Write a scene with at least one tile."""
    write_arrays(path, dict(_arrays(scene)))


def read_region(path: Path) -> RegionScene:
    """Read a scene from a file that ``write_region`` wrote; arrays are identical, but read-only.

    Raises:
        One of ``foundation.errors.NPZ_DAMAGE``: The file is damaged.
    """
    arrays = map_arrays(path)
    meshes = meshes_from(arrays)
    origins_m, levels, lights_m = arrays["origin_m"], arrays["level"].tolist(), arrays["street_light_m"]
    details = arrays["detail"].tolist()
    obstacles, plazas, parking_spots = arrays["obstacle"], plazas_from(arrays), arrays["parking_spot"]
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
        parking_spots,
        arrays["rest"],
    )


def read_streetside(path: Path) -> Streetside:
    """Read only the roadside data of a region, without the meshes; raises like ``read_region``."""
    arrays = map_arrays(path)
    lights_m, obstacles = arrays["street_light_m"], arrays["obstacle"]
    return Streetside(lights_m, obstacles, plazas_from(arrays), arrays["parking_spot"], arrays["rest"])


def _arrays(scene: RegionScene) -> Iterator[tuple[str, AnyArray]]:
    """Named arrays of a scene: all meshes concatenated, and the tile and name of each."""
    meshes = [(row, name, mesh) for row, tile in enumerate(scene.tiles) for name, mesh in _named(tile)]
    yield "origin_m", np.array([tile.origin_m for tile in scene.tiles])
    yield "level", np.array([tile.level for tile in scene.tiles])
    yield "detail", np.array([tile.detail for tile in scene.tiles])
    yield "street_light_m", np.array([light.position_m for light in scene.street_lights]).reshape(-1, 3)
    yield "obstacle", scene.obstacles
    yield from plaza_arrays(scene.plazas)
    yield "parking_spot", scene.parking_spots
    yield "rest", scene.rests
    yield "tile", np.array([row for row, _, _ in meshes])
    yield "name", np.array([name for _, name, _ in meshes])
    yield from mesh_arrays([mesh for _, _, mesh in meshes])


def _named(tile: Tile) -> Iterator[tuple[str, Mesh]]:
    """Meshes of a tile by name: the visible mesh (empty name), the coarse mesh, then the label-only surfaces."""
    yield "", tile.mesh
    yield _COARSE, tile.coarse
    yield from tile.surfaces.items()
