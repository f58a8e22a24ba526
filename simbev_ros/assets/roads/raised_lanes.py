"""Builds lanes whose height above the carriageway's plane the map states, with faces down to the plane."""

from functools import partial

import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.drape import cover_mesh, edge_faces
from simbev_ros.assets.mesh.facets import Facets
from simbev_ros.assets.mesh.primitives import Finish
from simbev_ros.assets.placement.region_ground import RegionGround, Streets
from simbev_ros.assets.placement.tiles import TileBuilder
from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.semantics import Tag
from simbev_ros.maps.roads.lane_kind import ROAD_KINDS, LaneKind
from simbev_ros.maps.roads.raised_lanes import RaisedLanes

_GRID_M = 0.001
_CUT_TOLERANCE_M = 0.002
_ASPHALT = Finish(Material.ASPHALT, Tag.ROAD, (68, 69, 71))
_SHOULDER = Finish(Material.ASPHALT, Tag.GROUND, (86, 86, 86))
_PAVING = Finish(Material.PAVING, Tag.SIDEWALK, (148, 143, 135))
_CURB = Finish(Material.CONCRETE, Tag.SIDEWALK, (158, 156, 150))


def lay_raised_lanes(tiles: TileBuilder, ground: RegionGround, level: int, facets: Facets) -> None:
    """Build the raised lanes of a level, one strip after another; where strips overlap, the first one counts."""
    laid: BaseGeometry = shapely.Polygon()
    border = shapely.buffer(ground.region.area.boundary, _CUT_TOLERANCE_M)
    for strip in ground.raised[level].strips:
        lane = RaisedLanes([strip])
        surface, finish = _surface(ground.streets[level], strip.kind)
        area = ground.within(overlay.difference(overlay.intersection(surface, lane.area), laid, grid_size=_GRID_M))
        if area.is_empty:
            continue
        laid = overlay.union(laid, area)
        cover = partial(cover_mesh, finish=finish, rise_m=lane.nearest_rise_m)
        edges = overlay.difference(area.boundary, border)
        sides = partial(edge_faces, finish=_CURB, edges=edges, bottom_m=0.0, top_m=lane.nearest_rise_m)
        quads = overlay.intersection(lane.quads, area)
        tiles.drape(shapely.GeometryCollection(list(quads)), facets, cover, level=level)
        tiles.drape(area, facets, sides, level=level)


def _surface(streets: Streets, kind: LaneKind) -> tuple[BaseGeometry, Finish]:
    """The surface that lanes of a kind are part of, and their finish."""
    if kind in ROAD_KINDS:
        return streets.road, _ASPHALT
    if kind is LaneKind.SHOULDER:
        return streets.shoulder, _SHOULDER
    return (streets.median if kind is LaneKind.MEDIAN else streets.sidewalk), _PAVING
