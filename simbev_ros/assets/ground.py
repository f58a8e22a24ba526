"""The ground: road, sidewalks with their curbs, and the land between the streets."""

from dataclasses import dataclass
from functools import partial

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh import Mesh
from simbev_ros.assets.primitives import Finish, plate
from simbev_ros.assets.tiles import TILE_M, TileBuilder
from simbev_ros.semantics import Tag
from simbev_ros.types import Float64Array

CURB_HEIGHT_M = 0.12
"""Sidewalks lie so much above the road."""
LAND_HEIGHT_M = 0.10
"""Lawns and yards lie so much above the road, a little below the sidewalks."""

_CURB_WIDTH_M = 0.15
_PATH_RISE_M = 0.01
_HORIZON_M = 1500.0
_CUT_TOLERANCE_M = 0.002  # plans lie on a millimetre grid, and what is cut from them too

_ASPHALT = Finish(Material.ASPHALT, Tag.ROAD, (68, 69, 71))
_CURB = Finish(Material.CONCRETE, Tag.SIDEWALK, (158, 156, 150))
_PAVING = Finish(Material.PAVING, Tag.SIDEWALK, (148, 143, 135))
_VERGE = Finish(Material.SOIL, Tag.TERRAIN, (96, 82, 62))
_LAWN = Finish(Material.GRASS, Tag.TERRAIN, (88, 104, 60))
_YARD = Finish(Material.PAVING, Tag.GROUND, (138, 134, 127))


@dataclass(frozen=True, slots=True)
class GroundPlan:
    """What covers the ground, map frame, metres; the areas share borders and nothing else.

    Attributes:
        road: Carriageway, under crossings too.
        sidewalk: Up to the curb.
        lawn: Green land.
        yard: Paved land.
    """

    road: BaseGeometry
    sidewalk: BaseGeometry
    lawn: BaseGeometry
    yard: BaseGeometry


def lay_ground(tiles: TileBuilder, plan: GroundPlan) -> None:
    """Add all of the ground to the tiles."""
    curb = plan.sidewalk.intersection(plan.road.buffer(_CURB_WIDTH_M))
    tiles.cover(plan.road, partial(plate, _ASPHALT, z_m=0.0))
    tiles.cover(curb, partial(plate, _CURB, z_m=CURB_HEIGHT_M))
    tiles.cover(plan.sidewalk.difference(curb), partial(plate, _PAVING, z_m=CURB_HEIGHT_M))
    edges = plan.sidewalk.boundary
    shapely.prepare(edges)
    tiles.cover(plan.sidewalk, partial(_faces, _CURB, edges=edges, top_m=CURB_HEIGHT_M))
    for land, finish in ((plan.lawn, _LAWN), (plan.yard, _YARD)):
        if land.is_empty:
            continue
        tiles.cover(land, partial(plate, finish, z_m=LAND_HEIGHT_M))
        kerbless = land.boundary.intersection(plan.road.buffer(_CUT_TOLERANCE_M))
        tiles.cover(land, partial(_faces, _VERGE, edges=kerbless, top_m=LAND_HEIGHT_M))
    _lay_horizon(tiles, shapely.union_all([plan.lawn, plan.yard, plan.road, plan.sidewalk]))


def pave(tiles: TileBuilder, area: BaseGeometry) -> None:
    """Lay paths and forecourts on the lawns."""
    tiles.cover(area, partial(plate, _YARD, z_m=LAND_HEIGHT_M + _PATH_RISE_M))


def tile_aligned(bounds_m: Float64Array, margin_m: float) -> shapely.Polygon:
    """The rectangle of whole tiles around (4,) bounds and a margin."""
    low, high = np.floor((bounds_m[:2] - margin_m) / TILE_M), np.ceil((bounds_m[2:] + margin_m) / TILE_M)
    return shapely.box(*(low * TILE_M), *(high * TILE_M))


def _lay_horizon(tiles: TileBuilder, land: BaseGeometry) -> None:
    """Grass from the end of the land to where it meets the sky: a frame of four quads."""
    x0, y0, x1, y1 = land.bounds
    inner = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
    outer = inner + _HORIZON_M * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    corners = np.concatenate([np.column_stack([ring, np.full(4, LAND_HEIGHT_M)]) for ring in (inner, outer)])
    here, following = np.arange(4), np.roll(np.arange(4), -1)
    quads = np.stack([here, here + 4, following + 4, here, following + 4, following], axis=1)
    frame = Mesh.flat(corners[quads.reshape(-1, 3)], material=_LAWN.material, tag=_LAWN.tag, color=_LAWN.color)
    tiles.place_apart(frame)


def _faces(finish: Finish, piece: shapely.Polygon, edges: BaseGeometry, top_m: float) -> Mesh:
    """Upright faces from the road up to the rim of a raised piece, where its rim is one of the given edges."""
    piece = shapely.orient_polygons(piece)
    rings = [np.asarray(ring.coords)[:, :2] for ring in (piece.exterior, *piece.interiors)]
    starts, ends = np.concatenate([ring[:-1] for ring in rings]), np.concatenate([ring[1:] for ring in rings])
    middles = shapely.points((starts + ends) / 2.0)
    kept = shapely.dwithin(edges, middles, _CUT_TOLERANCE_M)
    starts, ends = starts[kept], ends[kept]
    corners = [
        np.column_stack([xy, np.full(len(xy), z)]) for xy, z in ((starts, 0), (ends, 0), (ends, top_m), (starts, top_m))
    ]
    a, b, c, d = corners
    lengths = np.linalg.norm(ends - starts, axis=1)
    s = np.cumsum(lengths)
    uv_a, uv_b = np.column_stack([s - lengths, a[:, 2]]), np.column_stack([s, b[:, 2]])
    uv_c, uv_d = np.column_stack([s, c[:, 2]]), np.column_stack([s - lengths, d[:, 2]])
    return Mesh.flat(
        np.stack([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)], axis=1).reshape(-1, 3, 3),
        uv=np.stack([np.stack([uv_a, uv_b, uv_c], axis=1), np.stack([uv_a, uv_c, uv_d], axis=1)], axis=1),
        material=finish.material,
        tag=finish.tag,
        color=finish.color,
    )
