"""Builds the ground surfaces of a region: streets with curbs, land and water, all following the terrain."""

from collections import defaultdict
from collections.abc import Sequence
from functools import partial

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.assets.land.covers import Cover, finish_of
from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.drape import cover_mesh, edge_faces
from simbev_ros.assets.mesh.facets import Facets
from simbev_ros.assets.mesh.primitives import Finish
from simbev_ros.assets.placement.region_ground import LAND_HEIGHT_M as LAND_HEIGHT_M
from simbev_ros.assets.placement.region_ground import RegionGround
from simbev_ros.assets.placement.tiles import TileBuilder
from simbev_ros.assets.roads.raised_lanes import lay_raised_lanes
from simbev_ros.assets.roads.repairs import lay_road
from simbev_ros.assets.roads.tunnels import bare_roofs
from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.semantics import Tag
from simbev_ros.maps.roads.lane_kind import CURB_HEIGHT_M

_CURB_WIDTH_M = 0.15
_GREEN_M = 0.9  # medians at least twice as wide as this are green
_STONE_SLOPES = ((0.8, 3.0), (1.3, 0.3))  # slopes held by stone walls, each with the minimum width in meters
_EMBANKMENT = (0.33, 2.5)
_ROUNDED_M, _MIN_PATCH_M2 = 0.9, 15.0
_RIM_M = 1.5  # width of land that continues below the water's surface
_CUT_TOLERANCE_M = 0.002  # plans lie on a millimeter grid, and what is cut from them too

_SHOULDER = Finish(Material.ASPHALT, Tag.GROUND, (86, 86, 86))
_CURB = Finish(Material.CONCRETE, Tag.SIDEWALK, (158, 156, 150))
_PAVING = Finish(Material.PAVING, Tag.SIDEWALK, (148, 143, 135))
_VERGE = Finish(Material.SOIL, Tag.TERRAIN, (96, 82, 62))
_STONE = Finish(Material.PAVING, Tag.WALL, (114, 110, 102))
_WATER = Finish(Material.WATER, Tag.WATER, (40, 54, 50))
_CROSSWALK = Finish(Material.PLAIN, Tag.ROAD, (255, 255, 255))

LAWN = Finish(Material.GRASS, Tag.TERRAIN, (88, 104, 60))
"""Finish of green medians."""


def lay_streets(tiles: TileBuilder, ground: RegionGround) -> None:
    """Build road, shoulders, medians and sidewalks of every level, and the label-only surface ``crosswalk``."""
    for level, facets in enumerate(ground.facets):
        if facets is not None:
            _lay_level(tiles, ground, level, facets)


def lay_land(tiles: TileBuilder, ground: RegionGround, covers: Sequence[Cover]) -> None:
    """Build the land between the streets on the ground: its covers, grass on slopes, and stone on very steep ones."""
    facets, decks, roofs = ground.land_facets, overlay.union_all(ground.decks), bare_roofs(ground)
    walls = [_steeper_than(facets, slope, min_width_m) for slope, min_width_m in _STONE_SLOPES]
    stone = overlay.difference(overlay.union_all(walls), decks)
    grass = overlay.difference(_steeper_than(facets, *_EMBANKMENT), overlay.union(decks, stone))
    if not roofs.is_empty:
        stone, grass = overlay.difference(stone, roofs), overlay.difference(grass, roofs)
    bare = overlay.union_all([decks, stone, grass, roofs])
    shapely.prepare([ground.land, bare])
    for (finish, rise_m, yaw_rad), parts in _by_appearance(covers).items():
        parts[:] = [part if ground.land.covers(part) else part & ground.land for part in parts]
        parts[:] = [part - bare if bare.intersects(part) else part for part in parts]
        layer = partial(cover_mesh, finish=finish, rise_m=LAND_HEIGHT_M + rise_m, yaw_rad=yaw_rad)
        tiles.drape(shapely.GeometryCollection(parts), facets, layer)
    lawn = finish_of("lawn", ground.network.features.surroundings.plants, ground.season)
    for area, finish, ceiling_m in ((stone, _STONE, None), (grass, lawn, None), (decks, _STONE, ground.soffit_m)):
        layer = partial(cover_mesh, finish=finish, rise_m=LAND_HEIGHT_M, ceiling_m=ceiling_m)
        tiles.drape(overlay.intersection(ground.land, area), facets, layer)
    if not roofs.is_empty:
        cover = partial(cover_mesh, finish=lawn, rise_m=LAND_HEIGHT_M, floor_m=ground.roof_m)
        tiles.drape(overlay.intersection(ground.land, roofs), facets, cover)
    _lay_verges(tiles, ground, overlay.difference(ground.land, decks))


def _by_appearance(covers: Sequence[Cover]) -> dict[tuple[Finish, float, float], list[BaseGeometry]]:
    """Areas of covers, grouped by equal appearance."""
    by_appearance = defaultdict(list)
    for cover in covers:
        by_appearance[cover.finish, cover.rise_m, cover.yaw_rad].append(cover.area)
    return by_appearance


def _lay_verges(tiles: TileBuilder, ground: RegionGround, land: BaseGeometry) -> None:
    """Vertical faces from the street up to the land, where no sidewalk hides them."""
    street = overlay.difference(ground.streets[0].area, ground.streets[0].sidewalk)
    edges = overlay.intersection(land.boundary, shapely.buffer(street, _CUT_TOLERANCE_M))
    for tube in ground.tubes[ground.network.layout.tunnel_levels.start :]:
        edges = overlay.difference(edges, shapely.buffer(tube, _CUT_TOLERANCE_M))
    verge = partial(edge_faces, finish=_VERGE, edges=edges, bottom_m=0.0, top_m=LAND_HEIGHT_M)
    tiles.drape(overlay.intersection(land, shapely.buffer(edges, _CURB_WIDTH_M)), ground.land_facets, verge)


def lay_water(tiles: TileBuilder, ground: RegionGround) -> None:
    """Build the surfaces of water, and the land below their edges."""
    for water in ground.water:
        area = ground.within(water.area)
        tiles.drape(
            area, Facets.from_level_region(ground.region), partial(cover_mesh, finish=_WATER, rise_m=water.surface_m)
        )
        rim = overlay.difference(area, overlay.union(shapely.buffer(water.area, -_RIM_M), ground.streets[0].area))
        tiles.drape(rim, ground.land_facets, partial(cover_mesh, finish=_VERGE, rise_m=LAND_HEIGHT_M))


def _lay_level(tiles: TileBuilder, ground: RegionGround, level: int, facets: Facets) -> None:
    """The streets of one level; streets on structures go into separate tiles."""
    streets, region = ground.streets[level], ground.region.area
    shoulder, sidewalk, median = (
        ground.at_plane(part, level) for part in (streets.shoulder, streets.sidewalk, streets.median)
    )
    crosswalk = ground.within(streets.crosswalk)
    lay_road(tiles, ground, level, facets)
    tiles.drape(shoulder, facets, partial(cover_mesh, finish=_SHOULDER, rise_m=0.0), level=level)
    markings = partial(cover_mesh, finish=_CROSSWALK, rise_m=0.0)
    tiles.drape(crosswalk, facets, markings, surface="crosswalk", level=level)
    paved = shapely.buffer(overlay.union(streets.road, streets.shoulder), _CURB_WIDTH_M)
    green = shapely.buffer(shapely.buffer(streets.median, -_GREEN_M), _GREEN_M) if level == 0 else shapely.Polygon()
    raised = overlay.union(sidewalk, median)
    edges = overlay.difference(raised.boundary, shapely.buffer(region.boundary, _CUT_TOLERANCE_M))
    sides = partial(edge_faces, finish=_CURB, edges=edges, bottom_m=0.0, top_m=CURB_HEIGHT_M)
    curb = overlay.intersection(raised, paved)
    lawn = overlay.intersection(overlay.difference(raised, curb), green)
    paving = overlay.difference(raised, overlay.union(curb, lawn))
    for area, finish in ((curb, _CURB), (paving, _PAVING), (lawn, LAWN)):
        tiles.drape(area, facets, partial(cover_mesh, finish=finish, rise_m=CURB_HEIGHT_M), sides, level=level)
    lay_raised_lanes(tiles, ground, level, facets)


def _steeper_than(facets: Facets, slope: float, min_width_m: float) -> BaseGeometry:
    """Area where facets are steeper than a slope, rounded off, without narrow or small parts."""
    steep = np.linalg.norm(facets.planes[:, 0, :2], axis=1) > slope
    area = shapely.buffer(overlay.union_all(shapely.polygons(facets.corners_m[steep])), _ROUNDED_M, quad_segs=3)
    inset_m = _ROUNDED_M + min_width_m / 2.0
    opened = shapely.buffer(shapely.buffer(area, -inset_m, quad_segs=3), inset_m - _ROUNDED_M / 2.0, quad_segs=3)
    parts = shapely.get_parts(opened)
    return shapely.MultiPolygon(parts[shapely.area(parts) > _MIN_PATCH_M2].tolist())
