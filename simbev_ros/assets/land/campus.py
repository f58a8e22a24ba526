"""Lays out campus blocks: long buildings on lawns, paths between them, plazas, parking lots, many trees."""

import numpy as np
import shapely

from simbev_ros.assets.land.blocks import Block
from simbev_ros.assets.land.covers import PATH_RISE_M
from simbev_ros.assets.land.fencing import fence_line
from simbev_ros.assets.land.parking import MODULE_M, parking_lot
from simbev_ros.assets.land.planting import scatter
from simbev_ros.assets.land.plazas import Pavement
from simbev_ros.assets.land.rows import Site, build_rows, erect, site_at
from simbev_ros.assets.land.yard import Yard
from simbev_ros.assets.street.furniture import bench, bicycle_rack
from simbev_ros.config.draw import sample
from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.geometry.plan_view import left_of

_PATH_M, _PLAZA_M, _ON_PLAZA_M = 3.0, 9.0, 1.5
_M2_PER_PLANT = 85.0
_INNER_SPACING_M = 70.0


def lay_out_campus(yard: Yard, block: Block) -> None:
    """Lay out a campus block: buildings along its streets and in its interior."""
    rng = yard.ground.stream(f"campus.{block.name}")
    yard.cover(block.land, "lawn", block.recipe.plants)
    _put_parking(yard, block, rng)
    sites = build_rows(yard, block, _kind, rng, density=block.recipe.building_density)
    sites += _inner_buildings(yard, block, rng)
    shapely.prepare(block.land)
    pavements = [_pave(yard, block, site) for site in sites]
    paved = overlay.union_all([pavement.area for pavement in pavements])
    yard.cover(paved, "plaza", rise_m=PATH_RISE_M)
    yard.pavements += pavements
    for site in sites:
        _furnish(yard, block, site, rng)
    if block.recipe.plant_density > 0.0:
        area = block.land.buffer(-1.5)
        scatter(yard, area, _M2_PER_PLANT / block.recipe.plant_density, block.recipe.plants, "park", rng)


def _kind(height_m: float, rng: np.random.Generator) -> str:
    return "school" if rng.random() < 0.15 else "lecture_block"


def _inner_buildings(yard: Yard, block: Block, rng: np.random.Generator) -> list[Site]:
    """Buildings in the interior of a block, aligned with its longest street."""
    if not block.frontage:
        return []
    longest = max(block.frontage, key=lambda line: line.length_m)
    _, along = longest.chord(0.0, longest.length_m)
    inner = block.land.buffer(-8.0)
    shapely.prepare(inner)
    x0, y0, x1, y1 = inner.bounds if not inner.is_empty else (0.0, 0.0, 0.0, 0.0)
    sites = []
    for x_m in np.arange(x0 + 20.0, x1, _INNER_SPACING_M):
        for y_m in np.arange(y0 + 20.0, y1, _INNER_SPACING_M):
            position_m = np.array([x_m, y_m]) + rng.uniform(0.0, 20.0, 2)
            direction = left_of(along) if rng.random() < 0.5 else along
            height_m = sample(block.recipe.building_height_m, rng)
            site = site_at("lecture_block", position_m, direction, block.recipe, rng, 0.0, height_m)
            fits = inner.contains(site.footprint) and yard.inside.contains(site.footprint)
            if rng.random() < block.recipe.building_density and fits and yard.claims.is_free(site.footprint):
                erected = erect(yard, site, block.recipe, rng)
                sites += [erected] if erected is not None else []
    return sites


def _pave(yard: Yard, block: Block, site: Site) -> Pavement:
    """A plaza in front of the entrance, and a path from it to the street."""
    edge_m = site.street_m - 0.3
    areas = [site.quad((-_PATH_M / 2.0, _PATH_M / 2.0), (edge_m, -_PLAZA_M + 0.5))] if edge_m < -_PLAZA_M else []
    areas.append(site.quad((-8.0, 8.0), (max(edge_m, -_PLAZA_M), -0.2)))
    path_m = np.stack([site.map_point(0.0, site.street_m), site.map_point(0.0, max(edge_m, -_PLAZA_M) + _ON_PLAZA_M)])
    yard.claims.add(shapely.LineString(path_m).buffer(_PATH_M / 2.0))
    return Pavement(overlay.intersection(overlay.union_all(areas), block.land), path_m[None])


def _furnish(yard: Yard, block: Block, site: Site, rng: np.random.Generator) -> None:
    """Benches and racks beside the entrance, a hedge along the front."""
    front_m = max(-4.5, site.street_m + 1.2)
    for mesh, x_m in ((bench(), 6.5), (bench(), -6.5), (bicycle_rack(), 10.5)):
        position_m = site.map_point(x_m, front_m)
        room = shapely.Point(position_m).buffer(1.9, quad_segs=2)
        if rng.random() < 1.4 * block.recipe.furniture_density and yard.claim(room, block.land):
            yard.ensemble.put(mesh, position_m, site.yaw_rad - np.pi / 2.0)
    if rng.random() < 0.8 * block.recipe.fence_density:
        half_m = site.plot.width_m / 2.0
        for start_m, end_m in ((-half_m, -9.0), (9.0, half_m)):
            if end_m - start_m > 5.0:
                fence_line(yard, "hedge", site.map_point(start_m, -2.0), site.map_point(end_m, -2.0), block.land, rng)


def _put_parking(yard: Yard, block: Block, rng: np.random.Generator) -> None:
    """A parking lot for a sufficiently large block, at one of its streets."""
    for line in sorted(block.frontage, key=lambda line: -line.length_m)[:2]:
        width_m = min(60.0, 0.35 * line.length_m)
        if width_m < 20.0 or rng.random() < 0.4:
            continue
        position_m, along = line.chord(0.08 * line.length_m, width_m)
        drive_m = position_m + left_of(along) * 3.0
        if parking_lot(yard, drive_m, along, width_m, 2 * MODULE_M + 1.6, block.land):
            return
