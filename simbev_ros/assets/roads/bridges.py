"""Builds the structures that carry roads: decks with parapets, girders, abutments, and pillars down to the land."""

from functools import partial

import numpy as np
import shapely
from scipy.spatial import cKDTree
from shapely.geometry.base import BaseGeometry

from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.drape import cover_mesh, edge_faces
from simbev_ros.assets.mesh.facets import Facets
from simbev_ros.assets.mesh.primitives import Finish
from simbev_ros.assets.placement.claims import Claims
from simbev_ros.assets.placement.region_ground import DECK_DEPTH_M, DECK_OVERHANG_M, MARGIN_M, RegionGround
from simbev_ros.assets.placement.tiles import TileBuilder
from simbev_ros.assets.roads.pillars import put_pillars
from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Float64Array

_SLAB_M = 0.4  # thickness of the deck where no girder is below
_GIRDER_INSET_M = 1.3
_PARAPET_M = 0.8
_RAIL_M, _RAIL_DEPTH_M, _RAIL_WIDTH_M = 1.14, 0.07, 0.1  # a handrail on the parapets
_POST_SPACING_M, _POST_M = 2.4, 0.045
_SLIVER_M = 0.5
_MIN_AREA_M2 = 1.5  # smaller areas are gaps between surfaces, not parapets
_SAME_PLACE_M = 0.6
_SEAM_M = 0.01
_ABUTMENT_AT_M, _ABUTMENT_DEPTH_M, _ABUTMENT_HEIGHT_M = 2.2, 0.8, 9.0
_FROM_LOWER_ROAD_M = 1.0

_CONCRETE = Finish(Material.CONCRETE, Tag.BRIDGE, (160, 158, 152))
_RAIL = Finish(Material.METAL, Tag.BRIDGE, (92, 97, 98))
_UNDERSIDE = Finish(Material.CONCRETE, Tag.BRIDGE, (140, 138, 133))
_ABUTMENT = Finish(Material.CONCRETE, Tag.WALL, (150, 147, 140))


def build_bridges(tiles: TileBuilder, claims: Claims, ground: RegionGround) -> None:
    """Build all structures of a region, and claim the land below them."""
    for level, facets in enumerate(ground.facets):
        if level == 0 or facets is None or level in ground.network.layout.tunnel_levels:
            continue
        claims.add(ground.decks[level])
        landings, seams = (_joints(ground, level, onto_ground) for onto_ground in (True, False))
        _build_deck(tiles, ground, level, facets, landings, seams)
        _build_abutments(tiles, ground, level, facets, landings)
        put_pillars(tiles, ground, level)


def _joints(ground: RegionGround, level: int, onto_ground: bool) -> BaseGeometry:
    """Lines across the road where a structure's lanes continue on the ground, or on a structure of another level."""
    around = shapely.box(*shapely.buffer(ground.region.area, MARGIN_M).bounds)
    own: list[Float64Array] = []
    other: list[Float64Array] = []
    for strip in ground.network.layout.near(around, 0.0).strips:
        if strip.outline_m is None:
            ends = [np.stack([strip.left_m[k], strip.right_m[k]]) for k in (0, -1)]
            if strip.level == level:
                own.extend(ends)
            elif (strip.level == 0) == onto_ground:
                other.extend(ends)
    if not own or not other:
        return shapely.MultiLineString()
    own_m, other_m = np.stack(own), np.stack(other)
    gap_m = cKDTree(other_m.mean(axis=1)).query(own_m.mean(axis=1))[0]
    return overlay.union_all(shapely.linestrings(own_m[gap_m < _SAME_PLACE_M, :, :2]))


def _build_deck(
    tiles: TileBuilder,
    ground: RegionGround,
    level: int,
    facets: Facets,
    landings: BaseGeometry,
    seams: BaseGeometry,
) -> None:
    """Parapets along the edges, the slab and the girder below it; at seams the next structure continues."""
    region, deck = ground.region.area, ground.streets[level].area
    across = shapely.buffer(overlay.union(landings, seams), DECK_OVERHANG_M + 0.01, cap_style="flat")
    rims = shapely.get_parts(overlay.difference(ground.decks[level], overlay.union(deck, across)))
    parapet = overlay.union_all(rims[shapely.area(rims) > _MIN_AREA_M2])
    slab = overlay.union(deck, parapet)
    onward = shapely.buffer(seams, 2.0 * _GIRDER_INSET_M, cap_style="flat")
    girder: BaseGeometry = shapely.buffer(overlay.union(slab, onward), -_GIRDER_INSET_M, join_style="mitre")
    girder = overlay.intersection(girder, slab)
    walls = partial(edge_faces, finish=_CONCRETE, edges=parapet.boundary, bottom_m=-_SLAB_M, top_m=_PARAPET_M)
    beside = overlay.difference(girder.boundary, shapely.buffer(seams, _SEAM_M))
    sides = partial(edge_faces, finish=_UNDERSIDE, edges=beside, bottom_m=-DECK_DEPTH_M, top_m=-_SLAB_M)
    ends = partial(edge_faces, finish=_UNDERSIDE, edges=landings, bottom_m=-DECK_DEPTH_M, top_m=0.0)
    for area, makes in (
        (parapet, [partial(cover_mesh, finish=_CONCRETE, rise_m=_PARAPET_M), walls]),
        (overlay.difference(slab, girder), [partial(cover_mesh, finish=_UNDERSIDE, rise_m=-_SLAB_M, downward=True)]),
        (girder, [partial(cover_mesh, finish=_UNDERSIDE, rise_m=-DECK_DEPTH_M, downward=True), sides]),
        (overlay.intersection(deck, across), [ends]),
    ):
        tiles.drape(overlay.intersection(area, region), facets, *makes)
    _build_rail(tiles, deck, parapet, region, facets)


def _build_rail(
    tiles: TileBuilder, deck: BaseGeometry, parapet: BaseGeometry, region: BaseGeometry, facets: Facets
) -> None:
    """A handrail on posts along the middle of the parapets."""
    middle = shapely.buffer(deck, DECK_OVERHANG_M / 2.0, join_style="mitre").boundary
    lines = shapely.get_parts(shapely.line_merge(overlay.intersection(middle, parapet)))
    lines = lines[shapely.length(lines) > _POST_SPACING_M]
    positions = [shapely.line_interpolate_point(line, np.arange(0.6, line.length, _POST_SPACING_M)) for line in lines]
    posts = overlay.union_all(
        [square for line_positions in positions for square in shapely.buffer(line_positions, _POST_M, quad_segs=1)]
    )
    rail = overlay.union_all(shapely.buffer(lines, _RAIL_WIDTH_M / 2.0, cap_style="flat", join_style="mitre"))
    under_m = _RAIL_M - _RAIL_DEPTH_M
    top = partial(cover_mesh, finish=_RAIL, rise_m=_RAIL_M)
    bottom = partial(cover_mesh, finish=_RAIL, rise_m=under_m, downward=True)
    sides = partial(edge_faces, finish=_RAIL, edges=rail.boundary, bottom_m=under_m, top_m=_RAIL_M)
    stems = partial(edge_faces, finish=_RAIL, edges=posts.boundary, bottom_m=_PARAPET_M, top_m=under_m)
    for area, makes in ((rail, [top, bottom, sides]), (posts, [stems])):
        tiles.drape(overlay.intersection(area, region), facets, *makes)


def _build_abutments(
    tiles: TileBuilder, ground: RegionGround, level: int, facets: Facets, joints: BaseGeometry
) -> None:
    """Walls below the ends of a structure, down into the slope, in front of any road that passes close by."""
    slab = ground.decks[level]
    below = [overlay.intersection(slab, streets.area) for streets in ground.streets[:level]]
    roads = shapely.buffer(shapely.buffer(overlay.union_all(below), -_SLIVER_M), _SLIVER_M)
    for joint in shapely.get_parts(shapely.line_merge(joints)):
        room_m = shapely.distance(joint, roads) - _FROM_LOWER_ROAD_M - _ABUTMENT_DEPTH_M
        at_m = float(np.clip(np.nan_to_num(room_m, nan=np.inf), 0.05, _ABUTMENT_AT_M))
        far, near = (shapely.buffer(joint, reach_m, cap_style="flat") for reach_m in (at_m + _ABUTMENT_DEPTH_M, at_m))
        wall = overlay.intersection(overlay.difference(far, near), slab)
        sides = partial(edge_faces, finish=_ABUTMENT, edges=wall.boundary, bottom_m=-_ABUTMENT_HEIGHT_M, top_m=-_SLAB_M)
        tiles.drape(overlay.intersection(wall, ground.region.area), facets, sides)
