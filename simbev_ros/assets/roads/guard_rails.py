"""Builds guard rails along fast roads, and where the land drops beside any road."""

from collections.abc import Iterator

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.facets import TILE_M
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.mesh.primitives import Finish, boxes, loft
from simbev_ros.assets.placement.claims import Claims
from simbev_ros.assets.placement.region_ground import RegionGround
from simbev_ros.assets.placement.tiles import TileBuilder, upright_pose
from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import BoolArray, Float64Array
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.surface import strip_polygons

_FAST_MPS = 80.0 / 3.6
_FROM_STREET_M = 0.5
_DROP_M, _DROP_WITHIN_M = 2.5, 8.0  # a drop: height difference within a distance beside the street
_MIN_LENGTH_M = 8.0
_STEP_M, _POST_SPACING_M = 2.0, 4.0
_TOP_M = 0.75
_ROOM_M = 0.35
_BESIDE_M = 4.5

_STEEL = Finish(Material.METAL, Tag.GUARD_RAIL, (146, 150, 153))
# Cross-section of a W-beam (EN 1317 type A) about its center, from the bottom up: distance from the front, and height.
_BACK_M = np.array([0.0, 0.08, 0.08, 0.0, 0.0, 0.08, 0.08, 0.0])
_UP_M = np.array([-0.155, -0.11, -0.06, -0.02, 0.02, 0.06, 0.11, 0.155])
_THICKNESS_M = 0.012


def put_guard_rails(tiles: TileBuilder, claims: Claims, ground: RegionGround) -> None:
    """Build the guard rails of a region; they are open where roads join."""
    for line in _lines(ground):
        rail = guard_rail(ground, line)
        middle_m = shapely.get_coordinates(line.interpolate(0.5, normalized=True))[0]
        claims.add(shapely.buffer(line, _ROOM_M, cap_style="flat"))
        pose = upright_pose(middle_m, 0.0)
        tiles.place(rail.transform(upright_pose(-middle_m, 0.0)), pose)


def _lines(ground: RegionGround) -> Iterator[shapely.LineString]:
    """Lines of rails with the street on their left, each within one tile."""
    street = ground.streets[0].area
    edge = shapely.buffer(street, _FROM_STREET_M).boundary
    taken = overlay.union_all([shapely.buffer(street, 0.9 * _FROM_STREET_M), *ground.decks])
    fast = _beside_fast_roads(ground)
    shapely.prepare(fast)
    x0, y0, x1, y1 = ground.region.area.bounds
    corners_m = np.stack(np.meshgrid(np.arange(x0, x1, TILE_M), np.arange(y0, y1, TILE_M)), axis=-1).reshape(-1, 2)
    for tile in shapely.box(*corners_m.T, *(corners_m + TILE_M).T):
        inside = shapely.line_merge(overlay.difference(overlay.intersection(edge, tile), taken))
        for part in shapely.get_parts(inside):
            if part.geom_type == "LineString" and part.length >= _MIN_LENGTH_M:
                yield from _rail_stretches(ground, part, fast)


def _rail_stretches(ground: RegionGround, line: shapely.LineString, fast: BaseGeometry) -> Iterator[shapely.LineString]:
    """Sections of a line that need a rail."""
    stations_m = np.linspace(0.0, line.length, int(line.length / _STEP_M) + 2)
    position_m = shapely.get_coordinates(shapely.line_interpolate_point(line, stations_m))
    wanted = shapely.contains_xy(fast, position_m[:, 0], position_m[:, 1]) | _beside_drops(ground, position_m)
    changes = np.flatnonzero(np.diff(np.concatenate([[False], wanted, [False]]).astype(int)))
    for start, end in changes.reshape(-1, 2):
        if stations_m[end - 1] - stations_m[start] >= _MIN_LENGTH_M:
            yield shapely.LineString(position_m[start:end])


def _beside_fast_roads(ground: RegionGround) -> BaseGeometry:
    """Area near fast roads that is not near a sidewalk."""
    lanes = ground.network.layout.near(ground.region.area, _BESIDE_M).strips_of(LaneKind.DRIVING, level=0)
    fast = [strip for strip in lanes if strip.speed_mps >= _FAST_MPS and not strip.junction]
    near, walks = (
        shapely.buffer(area, _BESIDE_M, quad_segs=4)
        for area in (overlay.union_all(strip_polygons(fast)), ground.streets[0].sidewalk if fast else shapely.Polygon())
    )
    return overlay.difference(near, walks)


def _beside_drops(ground: RegionGround, position_m: Float64Array) -> BoolArray:
    """(N,) whether the land drops on the right of a line through (N, 2) points."""
    along = np.gradient(position_m, axis=0)
    right = np.column_stack([along[:, 1], -along[:, 0]]) / np.maximum(
        np.linalg.norm(along, axis=1, keepdims=True), 1e-9
    )
    return ground.land_m(position_m) - ground.land_m(position_m + _DROP_WITHIN_M * right) > _DROP_M


def guard_rail(ground: RegionGround, line: shapely.LineString) -> Mesh:
    """Build the beam and the posts of a rail with the street on the left of a line, in the map frame."""
    stations_m = np.linspace(0.0, line.length, int(line.length / _STEP_M) + 2)
    xy_m = shapely.get_coordinates(shapely.line_interpolate_point(line, stations_m))
    height_m = ground.land_m(xy_m)
    along = np.gradient(xy_m, axis=0)
    right = np.column_stack([along[:, 1], -along[:, 0]]) / np.linalg.norm(along, axis=1, keepdims=True)
    back_m = np.concatenate([_BACK_M, _BACK_M[::-1] + _THICKNESS_M])
    up_m = height_m + _TOP_M - _UP_M[-1]
    sections = np.empty((len(xy_m), len(back_m), 3))
    sections[..., :2] = xy_m[:, None] + back_m[:, None] * right[:, None]
    sections[..., 2] = up_m[:, None] + np.concatenate([_UP_M, _UP_M[::-1]])
    post = slice(0, None, round(_POST_SPACING_M / _STEP_M))
    center_m = np.column_stack([(xy_m + 0.12 * right)[post], height_m[post] + _TOP_M / 2.0 - 0.3])
    posts = boxes(_STEEL, np.tile([0.1, 0.1, _TOP_M + 0.5], (len(center_m), 1)), center_m)
    return Mesh.merge([loft(_STEEL, sections, caps=False), posts])
