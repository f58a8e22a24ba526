"""Small maps whose roads are given by formulas, and their ground without the objects on it."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import shapely

from simbev_ros.assets.land.covers import Cover
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.placement.claims import Claims
from simbev_ros.assets.placement.region_ground import RegionGround
from simbev_ros.assets.placement.static_scene import Tile
from simbev_ros.assets.placement.tiles import TileBuilder
from simbev_ros.assets.roads.bridges import build_bridges
from simbev_ros.assets.roads.ground import LAWN, lay_land, lay_streets, lay_water
from simbev_ros.assets.roads.guard_rails import put_guard_rails
from simbev_ros.assets.roads.markings import paint_markings
from simbev_ros.assets.roads.tunnels import build_tunnels
from simbev_ros.foundation.geometry.geodesy import MapDatum
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.land_features import MapFeatures, Water
from simbev_ros.maps.network import Lane, RoadNetwork
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import Layout, Strip
from simbev_ros.maps.roads.levels import assign_levels
from simbev_ros.maps.surroundings import ReliefRecipe, SurroundingsRecipe

STREET = ((LaneKind.SIDEWALK, 2.5), (LaneKind.DRIVING, 3.5), (LaneKind.DRIVING, 3.5), (LaneKind.SIDEWALK, 2.5))
MOTORWAY = (
    (LaneKind.SHOULDER, 2.5),
    (LaneKind.DRIVING, 3.75),
    (LaneKind.MEDIAN, 3.0),
    (LaneKind.DRIVING, 3.75),
    (LaneKind.SHOULDER, 2.5),
)
_SPACING_M = 4.0


def hilly_road() -> RoadNetwork:
    """A winding street over hills, across a region's border."""
    x = np.arange(-240.0, 240.1, _SPACING_M)
    line_m = np.column_stack([x, 20.0 * np.sin(x / 100.0), 8.0 * np.sin(x / 60.0)])
    return _network(_road("a", line_m, STREET), relief=ReliefRecipe(amplitude_m=20.0, wavelength_m=500.0))


def crossing(clearance_m: float = 7.0) -> RoadNetwork:
    """A motorway along x that passes over a street along y; the crossing is at the middle of a region."""
    y = np.arange(40.0, 470.1, _SPACING_M)
    lower = _road("low", np.column_stack([np.full(len(y), 256.0), y, np.zeros(len(y))]), STREET)

    def height_m(x: Float64Array) -> Float64Array:
        return clearance_m * np.exp(-(((x - 256.0) / 110.0) ** 4))

    return _network([*lower, *_bridge("up", (20.0, 226.0, 286.0, 492.0), 256.0, height_m, MOTORWAY)])


def stack() -> RoadNetwork:
    """A viaduct along x, 12 m high, above a bridge along y, 6 m high, above a street at height 0 askew to both."""

    def along(start_m: tuple[float, float], end_m: tuple[float, float], top_m: float, flat_m: float) -> Float64Array:
        plan_m = np.linspace(start_m, end_m, 201)
        from_middle_m = np.linalg.norm(plan_m - 256.0, axis=1)
        return np.column_stack([plan_m, top_m * np.clip(1.0 - (from_middle_m - flat_m) / 150.0, 0.0, 1.0)])

    viaduct = _road("viaduct", along((-150, 256), (662, 256), 12.0, 250.0), MOTORWAY)
    bridge = _road("bridge", along((256, -100), (256, 612), 6.0, 150.0), STREET)
    street = _road("street", along((40, 40), (472, 472), 0.0, 0.0), STREET)
    network = _network([*(replace(strip, structure=True) for strip in viaduct), *bridge, *street])
    return replace(network, layout=assign_levels(network.layout))


def river() -> RoadNetwork:
    """A level street along x that crosses a river 2.5 m below it."""
    y = np.arange(-40.0, 560.1, 5.0)
    area = shapely.LineString(np.column_stack([256.0 + 20.0 * np.sin(y / 60.0), y])).buffer(14.0)
    strips = _bridge("a", (20.0, 216.0, 296.0, 492.0), 256.0, np.zeros_like, STREET)
    return _network(strips, water=(Water(area, -2.5),))


def level_street() -> RoadNetwork:
    """A street along x at height 0."""
    x = np.arange(40.0, 470.1, _SPACING_M)
    return _network(_road("a", np.column_stack([x, np.full(len(x), 256.0), np.zeros(len(x))]), STREET))


def tunnel(street_m: float | None = 9.0) -> RoadNetwork:
    """A street along x at height 0 with a tunnel from x = 176 to 336, and maybe a street along y above its middle."""
    strips = []
    for start_m, end_m in ((40.0, 176.0), (176.0, 336.0), (336.0, 472.0)):
        x = np.arange(start_m, end_m + 0.1, _SPACING_M)
        line_m = np.column_stack([x, np.full(len(x), 256.0), np.zeros(len(x))])
        inside = start_m == 176.0
        strips += [replace(strip, tunnel=inside) for strip in _road(f"low{start_m:.0f}", line_m, STREET)]
    if street_m is not None:
        y = np.arange(40.0, 472.1, _SPACING_M)
        strips += _road("up", np.column_stack([np.full(len(y), 256.0), y, np.full(len(y), street_m)]), STREET)
    network = _network(strips)
    return replace(network, layout=assign_levels(network.layout))


def ground_tiles(ground: RegionGround) -> tuple[Tile, ...]:
    """Ground tiles of a region, without the objects that land recipes place."""
    tiles, claims = TileBuilder(), Claims()
    lay_streets(tiles, ground)
    paint_markings(tiles, ground)
    build_bridges(tiles, claims, ground)
    build_tunnels(tiles, claims, ground)
    put_guard_rails(tiles, claims, ground)
    lay_land(tiles, ground, [Cover(ground.land, LAWN)])
    lay_water(tiles, ground)
    return tiles.finish()


def merged(tiles: Sequence[Tile]) -> Mesh:
    """One mesh of all visible triangles of tiles, map frame."""
    meshes = []
    for tile in tiles:
        map_from_tile = np.eye(4)
        map_from_tile[:3, 3] = tile.origin_m
        meshes.append(tile.mesh.transform(map_from_tile))
    return Mesh.merge(meshes)


def _bridge(
    name: str,
    ends_m: tuple[float, float, float, float],
    y_m: float,
    height_m: Callable[[Float64Array], Float64Array],
    section: Sequence[tuple[LaneKind, float]],
) -> list[Strip]:
    """A road along x in three sections, the middle one on a structure."""
    strips = []
    for start_m, end_m, level in ((ends_m[0], ends_m[1], 0), (ends_m[1], ends_m[2], 1), (ends_m[2], ends_m[3], 0)):
        x = np.linspace(start_m, end_m, round((end_m - start_m) / _SPACING_M) + 1)
        line_m = np.column_stack([x, np.full(len(x), y_m), height_m(x)])
        strips += _road(f"{name}{start_m:.0f}", line_m, section, level)
    return strips


def _road(name: str, line_m: Float64Array, section: Sequence[tuple[LaneKind, float]], level: int = 0) -> list[Strip]:
    """Strips from left to right about an (N, 3) line, level across."""
    heading = np.gradient(line_m[:, :2], axis=0)
    heading /= np.linalg.norm(heading, axis=1, keepdims=True)
    left = np.column_stack([-heading[:, 1], heading[:, 0], np.zeros(len(line_m))])
    edges_m = sum(width_m for _, width_m in section) / 2.0 - np.cumsum([0.0, *(width_m for _, width_m in section)])
    return [
        Strip(
            id=f"{name}.{k}",
            lane=f"{name}.{k}",
            kind=kind,
            left_m=line_m + edges_m[k] * left,
            right_m=line_m + edges_m[k + 1] * left,
            road=name,
            index=k - 2,
            level=level,
            speed_mps=30.0,
        )
        for k, (kind, _) in enumerate(section)
    ]


def _network(strips: Sequence[Strip], relief: ReliefRecipe | None = None, water: tuple[Water, ...] = ()) -> RoadNetwork:
    lanes = {
        strip.id: Lane(strip.id, strip.road, 0, strip.kind, strip.center_m, 3.5, strip.speed_mps, "", ())
        for strip in strips
    }
    features = MapFeatures(SurroundingsRecipe(use="farmland"), water=water, relief=relief or ReliefRecipe())
    datum = MapDatum(42.0, -83.0, 100.0)
    return RoadNetwork(
        "analytic", lanes, {}, (), datum, Path("net"), Path("xodr"), Layout(tuple(strips), (), (), ()), features, 0
    )
