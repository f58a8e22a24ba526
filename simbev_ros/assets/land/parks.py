"""Lays out parks and traffic islands.

A park has paths that meet in the middle, benches beside them, hedges along the streets, a pond and trees; an island has
lawn with trees and bushes.
"""

import numpy as np
import shapely

from simbev_ros.assets.land.blocks import Block
from simbev_ros.assets.land.covers import PATH_RISE_M
from simbev_ros.assets.land.fencing import fence_along
from simbev_ros.assets.land.planting import scatter
from simbev_ros.assets.land.plazas import Pavement
from simbev_ros.assets.land.yard import Yard, yaw_of
from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.mesh.primitives import Finish, extrusion, plate
from simbev_ros.assets.placement.tiles import upright_pose
from simbev_ros.assets.street.furniture import bench
from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.geometry.plan_view import left_of
from simbev_ros.foundation.semantics import Tag
from simbev_ros.maps.land_features import ObjectKind

_PATH_M, _PLAZA_RADIUS_M, _ON_PLAZA_M = 2.6, 7.0, 1.5
_BENCH_SPACING_M, _BENCH_ROOM_M = 14.0, 0.95
_MIN_SIDE_M = 30.0
_M2_PER_PLANT = 75.0
_ISLAND_FROM_STREET_M, _ISLAND_M2_PER_PLANT = 2.5, 45.0
_MIN_AREA_M2 = 900.0
_WATER_RISE_M, _LEVEL_M = 0.02, 0.25
_WATER = Finish(Material.WATER, Tag.WATER, (40, 54, 50))
_RIM = Finish(Material.CONCRETE, Tag.STATIC, (142, 138, 130))


def lay_out_park(yard: Yard, block: Block) -> None:
    """Lay out a block as a park."""
    rng = yard.ground.stream(f"park.{block.name}")
    landscape = block.recipe.plants
    yard.cover(block.land, "lawn", landscape)
    if block.land.area > _MIN_AREA_M2:
        spokes = _lay_paths(yard, block)
        _dig_pond(yard, block, rng)
        for spoke in spokes:
            _put_benches(yard, block, spoke)
        for line in block.frontage:
            if rng.random() < 1.4 * block.recipe.fence_density:
                inner = line.line.offset_curve(1.0)
                fence_along(yard, "hedge", inner, block.land, rng) if inner.geom_type == "LineString" else None
    if block.recipe.plant_density > 0.0:
        scatter(yard, block.land.buffer(-1.2), _M2_PER_PLANT / block.recipe.plant_density, landscape, "park", rng)


def lay_out_island(yard: Yard, block: Block) -> None:
    """Lay out land in the middle of a street."""
    yard.cover(block.land, "lawn", block.recipe.plants)
    if block.recipe.plant_density > 0.0:
        green = shapely.buffer(block.land, -_ISLAND_FROM_STREET_M)
        rng = yard.ground.stream(f"island.{block.name}")
        scatter(yard, green, _ISLAND_M2_PER_PLANT / block.recipe.plant_density, block.recipe.plants, "park", rng)


def _lay_paths(yard: Yard, block: Block) -> list[shapely.LineString]:
    """Paths from the middle of each side to a round plaza, where they lie inside of the block."""
    middle = block.land.representative_point() if not block.land.contains(block.land.centroid) else block.land.centroid
    sides = [line for line in block.frontage if line.length_m > _MIN_SIDE_M]
    gates = [line.line.interpolate(0.5, normalized=True) for line in sides]
    spokes = [shapely.LineString([gate, middle]) for gate in gates]
    spokes = [spoke for spoke in spokes if block.land.buffer(0.5).contains(spoke) and spoke.length > _PLAZA_RADIUS_M]
    lines = [spoke.buffer(_PATH_M / 2.0, cap_style="square") for spoke in spokes]
    plaza = middle.buffer(_PLAZA_RADIUS_M, quad_segs=6)
    paths = overlay.intersection(overlay.union_all([plaza, *lines]), block.land)
    yard.claims.add(*(line.buffer(0.15) for line in lines), plaza)
    yard.cover(paths, "plaza", rise_m=PATH_RISE_M)
    if spokes:
        ends_m = [(spoke.length - _PLAZA_RADIUS_M + _ON_PLAZA_M) for spoke in spokes]
        inner_m = shapely.line_interpolate_point(spokes, ends_m)
        outer_m = shapely.line_interpolate_point(spokes, 0.0)
        paths_m = np.stack([shapely.get_coordinates(each) for each in (outer_m, inner_m)], axis=1)
        yard.pavements.append(Pavement(paths, paths_m))
    return spokes


def _put_benches(yard: Yard, block: Block, spoke: shapely.LineString) -> None:
    """Benches on the left of a path, facing the path."""
    start, end = np.asarray(spoke.coords)
    along = (end - start) / spoke.length
    left = left_of(along)
    for s_m in np.arange(6.0, spoke.length - _PLAZA_RADIUS_M, _BENCH_SPACING_M):
        position_m = start + along * s_m + left * (_PATH_M / 2.0 + 1.2)
        if yard.map_objects.replace((ObjectKind.BENCH,), position_m[None])[0]:
            continue
        if yard.claim(shapely.Point(position_m).buffer(_BENCH_ROOM_M, quad_segs=3), block.land):
            yard.ensemble.put(bench(), position_m, yaw_of(-left))


def _dig_pond(yard: Yard, block: Block, rng: np.random.Generator) -> None:
    """An irregular round pond on level land, between the middle of a park and one of its corners."""
    x0, y0, x1, y1 = block.land.bounds
    corner = np.array([(x0, x1)[int(rng.integers(2))], (y0, y1)[int(rng.integers(2))]])
    center = (np.array(block.land.centroid.coords[0]) + corner) / 2.0
    angles = np.arange(28) * (2.0 * np.pi / 28)
    radius = 9.0 + 1.6 * np.sin(2.0 * angles + rng.uniform(0, 6)) + 0.8 * np.sin(3.0 * angles + rng.uniform(0, 6))
    ring = radius[:, None] * np.column_stack([1.2 * np.cos(angles), np.sin(angles)])
    outline = shapely.Polygon(center + ring)
    heights_m = yard.ground.land_m(center + ring * 1.045)
    if np.ptp(heights_m) > _LEVEL_M or not yard.claim(outline.buffer(1.0), block.land.buffer(-2.0)):
        return
    yard.tiles.place(_pond(shapely.Polygon(ring)), upright_pose(center, float(heights_m.max())))


def _pond(outline: shapely.Polygon) -> Mesh:
    """Water at the height of the lawn, in a rim of stone."""
    rim = shapely.Polygon(np.asarray(outline.exterior.coords) * 1.045, [outline.exterior])
    return Mesh.merge([plate(_WATER, outline, _WATER_RISE_M), extrusion(_RIM, rim, -0.6, 0.16, crease_deg=0.0)])
