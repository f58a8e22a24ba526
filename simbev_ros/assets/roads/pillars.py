"""Builds pillars: rows of columns below a structure, from the land up to the girders, clear of all roads beneath."""

from collections.abc import Iterator

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.mesh.primitives import Finish, cylinder
from simbev_ros.assets.placement.region_ground import DECK_DEPTH_M, RegionGround
from simbev_ros.assets.placement.tiles import TileBuilder, upright_pose
from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.roads.lane_kind import LaneKind

_CONCRETE = Finish(Material.CONCRETE, Tag.BRIDGE, (154, 152, 146))
_SPACING_M = 26.0  # along a structure
_MIN_LENGTH_M = 14.0  # shorter sections of road rest on their ends
_ACROSS_M = 8.0  # width of deck per column
_RADIUS_M, _CLEARANCE_M = 0.55, 0.6
_SHIFTS_M = (0.0, 3.0, -3.0, 6.0, -6.0, 9.0, -9.0)  # along the road, to where there is room
_MIN_COLUMN_M = 1.5  # shorter columns are left out: the abutment carries the deck
_ROW_GAP_M = 9.0
_FOOT_M = 1.5  # into the ground


def put_pillars(tiles: TileBuilder, ground: RegionGround, level: int) -> None:
    """Build the pillars of a level that stand in the region."""
    lower = overlay.union_all([streets.area for streets in ground.streets[:level]])
    taken = shapely.buffer(lower, _RADIUS_M + _CLEARANCE_M)
    shapely.prepare(taken)
    deck = ground.streets[level].area
    shapely.prepare(deck)
    placed_m = np.empty((0, 2))
    for line in _lines(ground, level):
        for s_m in _stations(line.length):
            row_m = _row(line, s_m, deck, taken)
            if len(row_m) == 0 or (np.linalg.norm(placed_m - row_m.mean(axis=0), axis=1) < _ROW_GAP_M).any():
                continue
            placed_m = np.concatenate([placed_m, row_m])
            _put_columns(tiles, ground, level, row_m[ground.owns(row_m)])


def _lines(ground: RegionGround, level: int) -> Iterator[shapely.LineString]:
    """Left border of every road's innermost lane, in an order that does not depend on the region."""
    around = shapely.box(*shapely.buffer(ground.region.area, _SPACING_M).bounds)
    strips = ground.network.layout.near(around, 0.0).strips_of(LaneKind.DRIVING, level=level)
    lines = [shapely.LineString(strip.left_m[:, :2]) for strip in strips if abs(strip.index) == 1]
    lines = [line for line in lines if line.length > _MIN_LENGTH_M]
    yield from sorted(lines, key=lambda line: (line.length, line.coords[0]))


def _stations(length_m: float) -> Float64Array:
    """Distances of rows along a road."""
    count = max(1, round(length_m / _SPACING_M))
    return (np.arange(count) + 0.5) * length_m / count


def _row(line: shapely.LineString, s_m: float, deck: BaseGeometry, taken: BaseGeometry) -> Float64Array:
    """(N, 2) positions of columns side by side at a station, or near it if a road beneath is in the way; maybe none."""
    for shift_m in _SHIFTS_M:
        if not 0.0 < s_m + shift_m < line.length:
            continue
        at_m = s_m + shift_m + np.array([-0.1, 0.1])
        here, ahead = shapely.get_coordinates(shapely.line_interpolate_point(line, at_m))
        across = np.array([here[1] - ahead[1], ahead[0] - here[0]]) / np.linalg.norm(ahead - here)
        width = overlay.intersection(shapely.LineString([here - 40.0 * across, here + 40.0 * across]), deck)
        chord = min(shapely.get_parts(width), key=lambda part: part.distance(shapely.Point(here)), default=None)
        if chord is None or chord.length < 2.0 * _RADIUS_M:
            continue
        count = max(1, round(chord.length / _ACROSS_M))
        positions = shapely.line_interpolate_point(chord, (np.arange(count) + 0.5) / count, normalized=True)
        if not shapely.intersects(taken, positions).any():
            return shapely.get_coordinates(positions)
    return np.empty((0, 2))


def _put_columns(tiles: TileBuilder, ground: RegionGround, level: int, row_m: Float64Array) -> None:
    """Put columns at (N, 2) positions."""
    if len(row_m) == 0:
        return
    tops_m = ground.road_m(row_m, level) - DECK_DEPTH_M + 0.05
    feet_m = ground.land_m(row_m)
    for position_m, foot_m, top_m in zip(row_m, feet_m, tops_m, strict=True):
        if top_m - foot_m > _MIN_COLUMN_M:
            tiles.place(_column(top_m - foot_m), upright_pose(position_m, foot_m))


def _column(height_m: float) -> Mesh:
    """A round column with its head; origin at the foot."""
    shaft = cylinder(_CONCRETE, (0.0, 0.0, -_FOOT_M), (0.0, 0.0, height_m), _RADIUS_M, segments=14)
    head = cylinder(
        _CONCRETE,
        (0.0, 0.0, height_m - 0.9),
        (0.0, 0.0, height_m),
        _RADIUS_M,
        end_radius_m=1.5 * _RADIUS_M,
        segments=14,
    )
    return Mesh.merge([shaft, head])
