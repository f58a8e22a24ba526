"""Lays out farmland: fields on a lattice that spans the whole map, hedgerows, fences along roads, farmsteads."""

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.assets.land.blocks import Block, Frontage
from simbev_ros.assets.land.covers import PATH_RISE_M, draw_crop
from simbev_ros.assets.land.fencing import fence_along
from simbev_ros.assets.land.planting import plant_mixed, random_positions, scatter
from simbev_ros.assets.land.rows import Site, erect, site_at
from simbev_ros.assets.land.yard import Yard, quad
from simbev_ros.assets.street.furniture import mailbox
from simbev_ros.assets.street.yard_things import hay_bale, pallets, wood_pile
from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.geometry.plan_view import left_of
from simbev_ros.foundation.random import stream
from simbev_ros.foundation.types import Float64Array

_FIELD_M = (150.0, 210.0)
_MARGIN_M, _VERGE_M = 1.2, 3.2
_MIN_AREA_M2 = 300.0
_HEDGEROW_SHARE, _TREE_SPACING_M = 0.3, 4.5
_FARM_SPACING_M, _FARM_LENGTH_M = 420.0, 64.0
_AVENUE_SHARE, _AVENUE_SPACING_M = 0.3, 11.0
_BALED_SHARE, _M2_PER_BALE = 0.12, 900.0
# Buildings of a farmstead: kind, position along the street and away from it, height.
_FARMSTEAD = (
    ("farmhouse", -16.0, 8.0, 5.5),
    ("barn", 14.0, 15.0, 4.4),
    ("shed", -14.0, 36.0, 3.8),
    ("silo", 16.0, 38.0, 10.0),
)


def lay_out_farmland(yard: Yard, block: Block) -> None:
    """Lay out a block of farmland: farmsteads along streets, fields, fences and trees."""
    rng = yard.ground.stream(f"farmland.{block.name}")
    _put_farmsteads(yard, block, rng)
    fields, rows = _plow(yard, block)
    yard.cover(overlay.difference(block.land, overlay.union_all(fields)), "meadow", block.recipe.plants)
    for line in block.frontage:
        if rng.random() < 0.6 * block.recipe.fence_density:
            inner = line.line.offset_curve(_VERGE_M - 0.8)
            if inner.geom_type == "LineString":
                fence_along(yard, "field", inner, block.land, rng)
        if rng.random() < _AVENUE_SHARE and block.recipe.plant_density > 0.0:
            _plant_avenue(yard, block, line, rng)
    if rows and block.recipe.plant_density > 0.0:
        _plant_rows(yard, block, np.concatenate(rows), rng)


def _plow(yard: Yard, block: Block) -> tuple[list[BaseGeometry], list[Float64Array]]:
    """Cover the block with fields; returns them, and (N, 2) positions of trees between them."""
    angle_rad = float(stream(yard.ground.network.seed, "fields").uniform(0.0, np.pi / 2.0))
    along = np.array([np.cos(angle_rad), np.sin(angle_rad)])
    soil = overlay.difference(block.land, yard.near_streets(_VERGE_M))
    shapely.prepare(soil)
    fields: list[BaseGeometry] = []
    rows: list[Float64Array] = []
    for column, row in _cells(block.land, along):
        rng = stream(yard.ground.network.seed, f"field.{column}.{row}")
        low_m = np.array([column, row]) * _FIELD_M
        cell = quad(np.zeros(2), along, (low_m[0], low_m[0] + _FIELD_M[0]), (low_m[1], low_m[1] + _FIELD_M[1]))
        split = float(rng.uniform(0.3, 0.7)) if rng.random() < 0.55 else 1.0
        crops = [draw_crop(block.recipe.plants, rng, yard.ground.season) for _ in range(2)]
        for (from_, to), crop in zip(((0.0, split), (split, 1.0)), crops, strict=True):
            if to - from_ < 0.05:
                continue
            x_m = low_m[0] + np.array([from_, to]) * _FIELD_M[0] + [_MARGIN_M, -_MARGIN_M]
            y_m = low_m[1] + np.array([_MARGIN_M, _FIELD_M[1] - _MARGIN_M])
            whole = quad(np.zeros(2), along, tuple(x_m), tuple(y_m))
            plan = overlay.intersection(soil, whole)
            if plan.area > _MIN_AREA_M2 or (plan.area > 0.0 and not yard.inside.contains(whole)):
                fields.append(plan)
                yard.cover(plan, crop, yaw_rad=angle_rad + (np.pi / 2.0) * (split < 1.0))
                _put_bales(yard, plan, rng)
        if rng.random() < _HEDGEROW_SHARE:
            side = shapely.get_coordinates(cell)[:2]
            share = np.arange(0.0, _FIELD_M[0], _TREE_SPACING_M) / _FIELD_M[0]
            positions = side[0] + share[:, None] * (side[1] - side[0]) + rng.normal(0.0, 1.3, (len(share), 2))
            rows.append(positions[shapely.contains_xy(soil, positions)])
    return fields, rows


def _cells(land: shapely.Polygon, along: Float64Array) -> list[tuple[int, int]]:
    """Lattice cells that an area's bounds touch."""
    corners = shapely.get_coordinates(shapely.box(*land.bounds))
    lattice = np.stack([corners @ along, corners @ left_of(along)], axis=1) / _FIELD_M
    low, high = np.floor(lattice.min(axis=0)).astype(int), np.floor(lattice.max(axis=0)).astype(int)
    return [(i, j) for i in range(low[0], high[0] + 1) for j in range(low[1], high[1] + 1)]


def _put_bales(yard: Yard, field: BaseGeometry, rng: np.random.Generator) -> None:
    """Round bales on some fields."""
    if rng.random() > _BALED_SHARE:
        return
    positions = random_positions(field.buffer(-4.0), _M2_PER_BALE, rng)
    positions = positions[shapely.contains_xy(yard.inside.buffer(-1.0), positions)]
    free = yard.claims.claim_discs(positions, np.full(len(positions), 1.0))
    yard.ensemble.put(hay_bale(), positions[free], rng.uniform(0.0, np.pi, int(free.sum())))


def _plant_rows(yard: Yard, block: Block, positions: Float64Array, rng: np.random.Generator) -> None:
    """Low-polygon trees and bushes along fields; ``plant_mixed`` keeps detailed trees near roads."""
    positions = positions[rng.random(len(positions)) < 0.4 + 0.6 * block.recipe.plant_density]
    big = rng.random(len(positions)) < 0.45
    plant_mixed(yard, positions[big], block.recipe.plants, "deep", rng)
    plant_mixed(yard, positions[~big], block.recipe.plants, "low", rng)


def _plant_avenue(yard: Yard, block: Block, line: Frontage, rng: np.random.Generator) -> None:
    """A row of detailed trees along a road, with gaps."""
    positions, along = line.stations(_AVENUE_SPACING_M, from_m=3.0)
    positions = positions + left_of(along) * rng.uniform(4.0, 5.0, (len(positions), 1))
    positions = positions[rng.random(len(positions)) < 0.85]
    plant_mixed(yard, positions[shapely.contains_xy(block.land, positions)], block.recipe.plants, "street", rng)


def _put_farmsteads(yard: Yard, block: Block, rng: np.random.Generator) -> None:
    """Farms along the roads of a block, each with its yard."""
    at_m = rng.uniform(0.2, 0.8) * _FARM_SPACING_M
    for line in block.frontage:
        while at_m < line.length_m:
            start_m = min(at_m, line.length_m - _FARM_LENGTH_M)
            if rng.random() < block.recipe.building_density and start_m > 0.0:
                _farmstead(yard, block, *line.chord(start_m, _FARM_LENGTH_M), rng)
            at_m += _FARM_SPACING_M
        at_m -= line.length_m


def _farmstead(
    yard: Yard, block: Block, position_m: Float64Array, along: Float64Array, rng: np.random.Generator
) -> None:
    """House, barn, shed and silo around a gravel yard with a drive to the road."""
    middle_m = position_m + along * _FARM_LENGTH_M / 2.0
    yard_plan = quad(middle_m, along, (-30.0, 30.0), (7.0, 58.0))
    land = block.land.buffer(-1.0)
    if not (land.contains(yard_plan) and yard.inside.contains(yard_plan) and yard.claims.is_free(yard_plan)):
        return
    shapely.prepare(land)
    sites = []
    for kind, x_m, y_m, height_m in _FARMSTEAD:
        site = site_at(kind, middle_m + along * x_m, along, block.recipe, rng, y_m, height_m)
        site = site.shift_along_front(-site.plot.width_m / 2.0)
        if land.contains(site.footprint) and yard.claims.is_free(site.footprint):
            erected = erect(yard, site, block.recipe, rng)
            sites += [erected] if erected is not None else []
    if not sites:
        return
    gravel = quad(middle_m, along, (-8.0, 24.0), (12.0, 34.0))
    drive = quad(middle_m, along, (-3.0, 1.0), (-0.3, 12.5))
    yard.cover(overlay.intersection(overlay.union(gravel, drive), block.land), "gravel", rise_m=PATH_RISE_M)
    yard.claims.add(drive)
    _furnish(yard, block, sites[0], middle_m, along, rng)
    scatter(yard, yard_plan, 110.0, block.recipe.plants, "garden", rng)
    yard.claims.add(yard_plan)


def _furnish(
    yard: Yard,
    block: Block,
    house: Site,
    middle_m: Float64Array,
    along: Float64Array,
    rng: np.random.Generator,
) -> None:
    """Loose objects in the yard, and the mailbox at the road."""
    things = ((pallets(), 6.0, 30.0, 1.0), (wood_pile(), -12.0, 32.0, 1.8), (mailbox(), -4.2, 0.9, 0.3))
    for mesh, x_m, y_m, room_m in things:
        position_m = middle_m + along * x_m + left_of(along) * y_m
        if yard.claim(shapely.Point(position_m).buffer(room_m, quad_segs=2), block.land):
            yard.ensemble.put(mesh, position_m, house.yaw_rad - np.pi / 2.0)
