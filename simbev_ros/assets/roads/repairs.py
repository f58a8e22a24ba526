"""Builds the carriageway's asphalt, with patches of other asphalt and manhole covers that make it look used."""

from functools import partial

import numpy as np
import shapely

from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.drape import cover_mesh
from simbev_ros.assets.mesh.facets import Facets
from simbev_ros.assets.mesh.primitives import Finish
from simbev_ros.assets.placement.region_ground import RegionGround
from simbev_ros.assets.placement.tiles import TileBuilder
from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.geometry.plan_view import left_of
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.roads.lane_kind import LaneKind

_ASPHALT = Finish(Material.ASPHALT, Tag.ROAD, (68, 69, 71))
_PATCH = Finish(Material.ASPHALT, Tag.ROAD, (54, 55, 57))
_OLD_PATCH = Finish(Material.ASPHALT, Tag.ROAD, (80, 79, 77))
_COVER = Finish(Material.PLAIN, Tag.ROAD, (56, 53, 50))  # cast iron, dull with dirt

_PATCH_SPACING_M, _COVER_SPACING_M, _TRENCH_SPACING_M = 70.0, 65.0, 170.0  # along lanes, on average
_PATCH_M, _TRENCH_M = ((1.5, 7.0), (0.8, 2.2)), ((9.0, 30.0), (0.4, 0.9))  # lengths and widths
_COVER_RADIUS_M = 0.34
_FROM_BORDER_M = 5.0  # repairs keep this distance from a region's border


def lay_road(tiles: TileBuilder, ground: RegionGround, level: int, facets: Facets) -> None:
    """Build the carriageway of a level."""
    road = ground.at_plane(ground.streets[level].road, level)
    if road.is_empty:
        return
    repairs = _repairs(ground, level)
    rest = overlay.difference(road, shapely.MultiPolygon([part for _, area in repairs for part in area.geoms]))
    for finish, area in ((_ASPHALT, rest), *((finish, overlay.intersection(road, area)) for finish, area in repairs)):
        tiles.drape(area, facets, partial(cover_mesh, finish=finish, rise_m=0.0), level=level)


def _repairs(ground: RegionGround, level: int) -> list[tuple[Finish, shapely.MultiPolygon]]:
    """Disjoint areas of patches and manhole covers, by finish."""
    rng = ground.stream(f"ground.repairs.{level}")
    patches = np.concatenate(
        [
            _rectangles(*_random_positions(ground, level, spacing_m, rng), size_m, rng)
            for spacing_m, size_m in ((_PATCH_SPACING_M, _PATCH_M), (_TRENCH_SPACING_M, _TRENCH_M))
        ]
    )
    covers, _ = _random_positions(ground, level, _COVER_SPACING_M, rng)
    discs = np.asarray(shapely.buffer(shapely.points(covers), _COVER_RADIUS_M, quad_segs=3), object)
    newer = rng.random(len(patches)) < 0.6
    inside = shapely.box(*(np.array(ground.region.area.bounds) + _FROM_BORDER_M * np.array([1, 1, -1, -1])))
    shapes = np.concatenate([discs if level == 0 else discs[:0], patches])
    earlier, later = shapely.STRtree(shapes).query(shapes, predicate="intersects")
    free = shapely.contains(inside, shapes)
    free[later[earlier < later]] = False
    layer = np.concatenate([np.zeros(len(shapes) - len(patches), int), np.where(newer, 1, 2)])
    return [
        (finish, shapely.MultiPolygon(list(shapes[free & (layer == number)])))
        for number, finish in enumerate((_COVER, _PATCH, _OLD_PATCH))
    ]


def _random_positions(
    ground: RegionGround, level: int, spacing_m: float, rng: np.random.Generator
) -> tuple[Float64Array, Float64Array]:
    """(N, 2) random positions on driving lanes in the region, and the (N, 2) unit directions of the lanes there."""
    strips = ground.network.layout.near(ground.region.area, 0.0).strips_of(LaneKind.DRIVING, level=level)
    lines = np.array([shapely.LineString(strip.center_m[:, :2]) for strip in strips], object)
    lengths_m = shapely.length(lines)
    count = rng.poisson(lengths_m / spacing_m)
    lines, lengths_m = lines.repeat(count), lengths_m.repeat(count)
    s_m = lengths_m * rng.random(len(lines))
    position_m = shapely.get_coordinates(shapely.line_interpolate_point(lines, s_m)).reshape(-1, 2)
    ahead_m = shapely.get_coordinates(shapely.line_interpolate_point(lines, s_m - 0.1)).reshape(-1, 2)
    direction = position_m - ahead_m
    direction /= np.maximum(np.linalg.norm(direction, axis=1, keepdims=True), 1e-9)
    return position_m + rng.uniform(-0.9, 0.9, (len(s_m), 1)) * left_of(direction), direction


def _rectangles(
    position_m: Float64Array,
    direction: Float64Array,
    size_m: tuple[tuple[float, float], tuple[float, float]],
    rng: np.random.Generator,
) -> np.ndarray[tuple[int], np.dtype[np.object_]]:
    """Patches of random size along the lanes."""
    along = direction * rng.uniform(*size_m[0], (len(position_m), 1)) / 2.0
    across = left_of(direction) * rng.uniform(*size_m[1], (len(position_m), 1)) / 2.0
    corners_m = [
        position_m - along - across,
        position_m + along - across,
        position_m + along + across,
        position_m - along + across,
    ]
    return np.asarray(shapely.polygons(np.stack(corners_m, axis=1)), object)
