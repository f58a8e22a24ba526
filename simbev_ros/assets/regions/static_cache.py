"""Static scenes on demand: each region is built once, alone, and then read from its file."""

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import asdict, replace
from functools import cached_property, partial
from pathlib import Path
from typing import TypeVar

import numpy as np

from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.facets import TILE_M
from simbev_ros.assets.placement.static_scene import StaticScene, StreetLight, Tile
from simbev_ros.assets.regions.far_land import FarLand, cells_of, far_land, far_tiles
from simbev_ros.assets.regions.region_file import read_region, read_streetside, write_region
from simbev_ros.assets.regions.region_scene import RegionScene, Streetside
from simbev_ros.assets.street.obstacles import OBSTACLE_DTYPE
from simbev_ros.assets.street.parking_spots import SPOT_DTYPE
from simbev_ros.assets.street.rest_kinds import REST_DTYPE
from simbev_ros.foundation.cache.entries import default_cache_dir, entry_path
from simbev_ros.foundation.cache.files import read_cached, writing_alone
from simbev_ros.foundation.cache.fingerprint import fingerprint
from simbev_ros.maps.land.terrain import Terrain
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.region import Reach, Reaches, Region, regions_of
from simbev_ros.maps.roads.tunnels import Tunnels
from simbev_ros.schema.scene.map_spec import MapSpec

_KIND = "surroundings"
_T = TypeVar("_T")


def load_static_scene(
    spec: MapSpec,
    network: RoadNetwork,
    cache_dir: Path | None = None,
    *,
    reach: Reach | Reaches | None = None,
) -> StaticScene:
    """The static scene of a map.

    Args:
        spec: The map.
        network: Its roads, from ``load_network``.
        cache_dir: Where regions that were built once are kept; ``default_cache_dir()`` when omitted.
        reach: Only tiles that it touches; the whole map when omitted.

    Raises:
        InputError: The cache cannot be written.
    """
    cache = StaticCache(spec, network, cache_dir)
    far = cache.far_land()
    tiles: list[Tile] = []
    lights: list[StreetLight] = []
    for region in regions_of(network.layout, reach):
        scene = cache.region(region)
        tiles += [_renumbered(tile, len(lights)) for tile in scene.tiles if reach is None or _touches(reach, tile)]
        lights += scene.street_lights
    around = (*tiles, *far_tiles(far, cells_of(far, tiles)))
    return StaticScene(around, tuple(lights), Tunnels.of_layout(network.layout))


def load_streetside(
    spec: MapSpec,
    network: RoadNetwork,
    cache_dir: Path | None = None,
    *,
    reach: Reach | Reaches | None = None,
) -> Streetside:
    """Load only the objects beside a map's streets. Arguments and errors as for ``load_static_scene``."""
    cache = StaticCache(spec, network, cache_dir)
    regions = [cache.streetside(region) for region in regions_of(network.layout, reach)]
    return Streetside(
        np.concatenate([np.empty((0, 3)), *(region.light_m for region in regions)]),
        np.concatenate([np.empty(0, OBSTACLE_DTYPE), *(region.obstacles for region in regions)]),
        tuple(plaza for region in regions for plaza in region.plazas),
        np.concatenate([np.empty(0, SPOT_DTYPE), *(region.parking_spots for region in regions)]),
        np.concatenate([np.empty(0, REST_DTYPE), *(region.rests for region in regions)]),
    )


class StaticCache:
    """The regions of one map on disk; a cached region has the same bytes as one that is built again."""

    def __init__(self, spec: MapSpec, network: RoadNetwork, cache_dir: Path | None = None) -> None:
        """Arguments as for ``load_static_scene``."""
        self._network, self._season = network, spec.season
        root = (cache_dir or default_cache_dir()) / _KIND
        key = f"{network.net_path.parent.name}\n{spec.seed}\n{spec.season}\n".encode()
        self._folder = entry_path(root, spec.name, fingerprint(__name__), key)
        self._lock_path = root / f".{spec.name}.lock"

    def building(self) -> AbstractContextManager[None]:
        """Context in which no other process of this user is in this context for the same map.

        Raises:
            InputError: The cache cannot be written.
        """
        return writing_alone(self._lock_path, _KIND)

    def missing(self, regions: Sequence[Region]) -> tuple[Region, ...]:
        """The regions that the cache does not hold yet."""
        return tuple(region for region in regions if not self._path(region).is_file())

    def region(self, region: Region) -> RegionScene:
        """Load a region, building it if it is not cached. Errors as for ``load_static_scene``."""
        return self._read_region(region, read_region)

    def streetside(self, region: Region) -> Streetside:
        """Load only the objects beside the streets of a region. Errors as for ``load_static_scene``."""
        return self._read_region(region, read_streetside)

    def _read_region(self, region: Region, read: Callable[[Path], _T]) -> _T:
        """Read a region's file, building it if it is not cached."""
        return read_cached(self._path(region), _KIND, read, partial(self._write_region, region=region))

    def far_land(self) -> FarLand:
        """Load the land beyond the regions. Errors as for ``load_static_scene``."""
        return read_cached(self._folder / "far_land.npz", _KIND, _read_far_land, self._write_far_land)

    @cached_property
    def _terrain(self) -> Terrain:
        return Terrain(self._network)

    def _path(self, region: Region) -> Path:
        return self._folder / f"{region.column}_{region.row}.npz"

    def _write_region(self, path: Path, region: Region) -> None:
        from simbev_ros.assets.regions.build import build_region  # takes long to load and is seldom needed

        write_region(path, build_region(self._network, region, self._terrain, self._season))

    def _write_far_land(self, path: Path) -> None:
        np.savez(path, allow_pickle=False, **asdict(far_land(self._network, self._terrain, self._season)))


def _read_far_land(path: Path) -> FarLand:
    with path.open("rb") as stream, np.load(stream, allow_pickle=False) as arrays:
        first = Region(*arrays["first"].tolist())
        return FarLand(first, arrays["height_m"], arrays["cover"], arrays["finish"])


def _touches(reach: Reach | Reaches, tile: Tile) -> bool:
    return bool(reach.touches(tile.origin_m[None, :2] - TILE_M / 2.0, TILE_M)[0])


def _renumbered(tile: Tile, first: int) -> Tile:
    """The tile, its street lamps counted from ``first`` on."""
    lamps = tile.mesh.material == Material.STREET_LAMP
    if first == 0 or not lamps.any():
        return tile
    uv = tile.mesh.uv.copy()
    uv[lamps, 0] += first
    return replace(tile, mesh=replace(tile.mesh, uv=uv))
