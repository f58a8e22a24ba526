"""Parks: paths that meet in the middle, benches beside them, hedges along the streets, a pond."""

import numpy as np
import shapely

from simbev_ros.assets.claims import Claims
from simbev_ros.assets.furniture import bench
from simbev_ros.assets.ground import LAND_HEIGHT_M
from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh import Mesh
from simbev_ros.assets.plants import hedge
from simbev_ros.assets.primitives import Finish, extrusion, plate
from simbev_ros.assets.tiles import TileBuilder, standing
from simbev_ros.assets.town_plan import Block, front_sides
from simbev_ros.semantics import Tag

_PATH_WIDTH_M, _PLAZA_RADIUS_M = 2.6, 7.0
_BENCH_SPACING_M, _BENCH_ROOM_M = 14.0, 0.95
_HEDGE_M, _HEDGE_GAP_M = 6.0, 0.2
_WATER_RISE_M = 0.015
_WATER = Finish(Material.WATER, Tag.WATER, (46, 74, 78))
_RIM = Finish(Material.CONCRETE, Tag.STATIC, (142, 138, 130))


def lay_out_park(tiles: TileBuilder, claims: Claims, block: Block, rng: np.random.Generator) -> shapely.MultiPolygon:
    """Add benches, hedges and pond of a park; returns its paths, from the middle of each side to a round place."""
    middle = block.land.centroid
    gates = [side.start_m + side.direction * side.length_m / 2.0 for side in front_sides(block, 30.0)]
    spokes = [shapely.LineString(np.array([gate, [middle.x, middle.y]])) for gate in gates]
    lines = [spoke.buffer(_PATH_WIDTH_M / 2.0) for spoke in spokes]
    paths = shapely.union_all([middle.buffer(_PLAZA_RADIUS_M), *lines])
    claims.add(paths.buffer(0.15))
    water = _pond_outline(block, rng)
    if block.land.buffer(-3.0).contains(water) and claims.claim(water.buffer(1.0)):
        center = water.centroid
        tiles.place(_pond(water), standing((center.x, center.y), LAND_HEIGHT_M))
    for spoke in spokes:
        _put_benches(tiles, claims, spoke)
    _put_hedges(tiles, claims, block, rng)
    return shapely.MultiPolygon(list(shapely.get_parts(paths)))


def _put_benches(tiles: TileBuilder, claims: Claims, spoke: shapely.LineString) -> None:
    """Benches on the left of a path, facing it."""
    start, end = np.asarray(spoke.coords)
    along = (end - start) / spoke.length
    left = np.array([-along[1], along[0]])
    for s_m in np.arange(6.0, spoke.length - _PLAZA_RADIUS_M, _BENCH_SPACING_M):
        place = start + along * s_m + left * (_PATH_WIDTH_M / 2.0 + 1.2)
        if claims.claim(shapely.Point(*place).buffer(_BENCH_ROOM_M, quad_segs=4)):
            tiles.place(bench(), standing(place, LAND_HEIGHT_M, float(np.arctan2(-left[1], -left[0]))))


def _put_hedges(tiles: TileBuilder, claims: Claims, block: Block, rng: np.random.Generator) -> None:
    """Hedges along the streets, open where paths are."""
    for side in front_sides(block, 2.0 * _HEDGE_M):
        for s_m in np.arange(2.0, side.length_m - _HEDGE_M - 2.0, _HEDGE_M + _HEDGE_GAP_M):
            start = side.start_m + side.direction * s_m + side.inward * 0.9
            line = shapely.LineString(np.array([start, start + side.direction * _HEDGE_M]))
            if claims.claim(line.buffer(0.45, cap_style="flat")):
                tiles.place(hedge(rng, _HEDGE_M), standing(start, LAND_HEIGHT_M, side.yaw_rad))


def _pond_outline(block: Block, rng: np.random.Generator) -> shapely.Polygon:
    """An irregular round, between the middle of a park and one of its corners."""
    x0, y0, x1, y1 = block.land.bounds
    corner = np.array([(x0, x1)[int(rng.integers(2))], (y0, y1)[int(rng.integers(2))]])
    center = (np.array([block.land.centroid.x, block.land.centroid.y]) + corner) / 2.0
    angles = np.arange(28) * (2.0 * np.pi / 28)
    radius = 9.0 + 1.6 * np.sin(2.0 * angles + rng.uniform(0, 6)) + 0.8 * np.sin(3.0 * angles + rng.uniform(0, 6))
    return shapely.Polygon(center + radius[:, None] * np.column_stack([1.2 * np.cos(angles), np.sin(angles)]))


def _pond(outline: shapely.Polygon) -> Mesh:
    """Water level with the lawn, in a rim of stone; origin at the outline's centroid."""
    center = np.array([outline.centroid.x, outline.centroid.y])
    ring = np.asarray(outline.exterior.coords) - center
    rim = shapely.Polygon(ring * 1.045, [ring])
    return Mesh.merged([plate(_WATER, shapely.Polygon(ring), _WATER_RISE_M), extrusion(_RIM, rim, -0.3, 0.16)])
