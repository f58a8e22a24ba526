"""Builds tunnels: box tubes with walls, a flat ceiling and rows of lamps, and a headwall at each portal.

Walls, ceiling and headwalls are tagged as walls, lamps as static. The land above is not cut open: where it is lower
than the roof of a tunnel, it is lifted onto the roof, and the walls hold it on the sides.
"""

from functools import partial

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.drape import cover_mesh, edge_faces
from simbev_ros.assets.mesh.facets import Facets
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.mesh.primitives import Finish, box
from simbev_ros.assets.placement.claims import Claims
from simbev_ros.assets.placement.region_ground import LAND_HEIGHT_M, MARGIN_M, RegionGround
from simbev_ros.assets.placement.tiles import TileBuilder, upright_pose
from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.semantics import Tag
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.tunnels import CLEARANCE_M, ROOF_M, WALL_M, lamps_along, portals_of

_PANEL = Finish(Material.PLASTER, Tag.WALL, (206, 203, 192))
_WALL = Finish(Material.CONCRETE, Tag.WALL, (124, 121, 115))
_CEILING = Finish(Material.CONCRETE, Tag.WALL, (126, 124, 119))
_HEADWALL = Finish(Material.CONCRETE, Tag.WALL, (158, 154, 146))
_LAMP = Finish(Material.TUNNEL_LAMP, Tag.STATIC, (255, 244, 220))
_HOUSING = Finish(Material.METAL, Tag.STATIC, (70, 72, 74))

_GRID_M, _CUT_TOLERANCE_M = 0.001, 0.002
_FOOT_M = 1.5  # depth of walls below the carriageway
_PANEL_M = 3.2  # height of the bright lower part of the walls
_HEADWALL_M, _WING_M, _PARAPET_M = 0.9, 3.0, 0.9
_COVER_M = 4.0  # land at least this high above a roof carries buildings
_LAMP_SIZE_M = (1.3, 0.34, 0.12)
_SHALLOW_MARGIN_M = 0.3


def build_tunnels(tiles: TileBuilder, claims: Claims, ground: RegionGround) -> None:
    """Build all tunnels of a region, and claim the land that covers them thinly."""
    for level in ground.network.layout.tunnel_levels:
        facets = ground.facets[level]
        if facets is None:
            continue
        portals = _portals(ground, level)
        headwalls = _headwalls(portals)
        _build_tube(tiles, ground, level, facets, portals)
        _build_headwalls(tiles, ground, level, facets, headwalls)
        _hang_lamps(tiles, ground, level)
        claims.add(headwalls, *shapely.get_parts(_land_below(ground, level, _COVER_M)))


def _portals(ground: RegionGround, level: int) -> BaseGeometry:
    """Lines across the road where the tunnels of a level end."""
    around = shapely.box(*shapely.buffer(ground.region.area, MARGIN_M).bounds)
    strips = ground.network.layout.near(around, 0.0).strips_of(*LaneKind, level=level)
    return overlay.union_all(shapely.linestrings(portals_of(strips)[:, :, :2]), grid_size=_GRID_M)


def bare_roofs(ground: RegionGround) -> BaseGeometry:
    """Area of the region in plan where tunnels reach up to the land or above it."""
    return overlay.union_all(
        [_land_below(ground, level, _SHALLOW_MARGIN_M) for level in ground.network.layout.tunnel_levels]
    )


def _land_below(ground: RegionGround, level: int, above_roof_m: float) -> BaseGeometry:
    """Area above the tunnels of a level whose facets of land lie lower than a height above the roof."""
    facets, tube = ground.land_facets, ground.tubes[level]
    if tube.is_empty:
        return shapely.Polygon()
    polygons = np.asarray(shapely.polygons(facets.corners_m), object)
    shapely.prepare(tube)
    near = np.flatnonzero(shapely.intersects(polygons, tube))
    parts = overlay.intersection(polygons[near], tube)
    xy_m, part = shapely.get_coordinates(parts, return_index=True)
    land_m = facets.heights_and_slopes(near[part], xy_m)[:, 0] + LAND_HEIGHT_M
    low = np.unique(part[land_m < ground.road_m(xy_m, level) + ROOF_M + above_roof_m])
    return overlay.intersection(overlay.union_all(polygons[near[low]]), tube)


def _build_tube(tiles: TileBuilder, ground: RegionGround, level: int, facets: Facets, portals: BaseGeometry) -> None:
    """Walls beside the road, and the ceiling; portals stay open."""
    region, road, tube = ground.region.area, ground.streets[level].area, ground.tubes[level]
    across = shapely.buffer(portals, WALL_M + 0.01, cap_style="square")
    walls = overlay.difference(tube, overlay.union(road, across))
    inside = overlay.intersection(walls.boundary, shapely.buffer(road, _CUT_TOLERANCE_M))
    panels = partial(edge_faces, finish=_PANEL, edges=inside, bottom_m=-_FOOT_M, top_m=_PANEL_M)
    above = partial(edge_faces, finish=_WALL, edges=inside, bottom_m=_PANEL_M, top_m=ROOF_M)
    outside = overlay.difference(walls.boundary, shapely.buffer(road, _CUT_TOLERANCE_M))
    shell = partial(edge_faces, finish=_HEADWALL, edges=outside, bottom_m=-_FOOT_M, top_m=ROOF_M)
    ceiling = partial(cover_mesh, finish=_CEILING, rise_m=CLEARANCE_M, downward=True)
    roof = partial(cover_mesh, finish=_HEADWALL, rise_m=ROOF_M)
    below_water = overlay.intersection(tube, overlay.union_all([water.area for water in ground.water]))
    tiles.drape(overlay.intersection(below_water, region), facets, roof, level=level)
    tiles.drape(overlay.intersection(walls, region), facets, panels, above, shell, level=level)
    tiles.drape(overlay.intersection(overlay.union(road, walls), region), facets, ceiling, level=level)


def _headwalls(portals: BaseGeometry) -> BaseGeometry:
    """Walls in plan along portals and beyond them on both sides."""
    lines = shapely.get_parts(shapely.line_merge(portals))
    ends_m = [shapely.get_coordinates(line)[[0, -1]] for line in lines]
    longer = [
        shapely.LineString([start - _WING_M * along, *shapely.get_coordinates(line), end + _WING_M * along])
        for line, (start, end) in zip(lines, ends_m, strict=True)
        for along in [(end - start) / max(float(np.linalg.norm(end - start)), 1e-6)]
    ]
    return overlay.union_all(shapely.buffer(longer, _HEADWALL_M / 2.0, cap_style="flat", join_style="mitre"))


def _build_headwalls(
    tiles: TileBuilder, ground: RegionGround, level: int, facets: Facets, headwalls: BaseGeometry
) -> None:
    """The portals' faces: above the opening, and on both sides of it down into the ground."""
    road = overlay.union(ground.streets[level].area, ground.streets[0].area)
    lintel, wings = overlay.intersection(headwalls, road), overlay.difference(headwalls, road)
    top_m = ROOF_M + _PARAPET_M
    top = partial(cover_mesh, finish=_HEADWALL, rise_m=top_m)
    underside = partial(cover_mesh, finish=_HEADWALL, rise_m=CLEARANCE_M, downward=True)
    for area, bottom_m, more in ((lintel, CLEARANCE_M, [underside]), (wings, -_FOOT_M, [])):
        sides = partial(edge_faces, finish=_HEADWALL, edges=area.boundary, bottom_m=bottom_m, top_m=top_m)
        tiles.drape(overlay.intersection(area, ground.region.area), facets, top, sides, *more, level=level)


def _hang_lamps(tiles: TileBuilder, ground: RegionGround, level: int) -> None:
    """Lamps below the ceiling, in a row above each driving lane."""
    length_m, width_m, depth_m = _LAMP_SIZE_M
    housing = box(_HOUSING, (length_m + 0.1, width_m + 0.1, 0.1), (0.0, 0.0, -0.05))
    lamp = Mesh.merge([box(_LAMP, _LAMP_SIZE_M, (0.0, 0.0, -depth_m)), housing])
    around = shapely.box(*shapely.buffer(ground.region.area, MARGIN_M).bounds)
    for strip in ground.network.layout.near(around, 0.0).strips_of(LaneKind.DRIVING, level=level):
        position_m, yaw_rad = lamps_along(strip)
        for k in np.flatnonzero(ground.owns(position_m[:, :2])).tolist():
            tiles.place(lamp, upright_pose(position_m[k], float(position_m[k, 2]), float(yaw_rad[k])), level)
