"""Lays out industrial blocks: halls and warehouses behind paved yards, fences, trailers, containers, pallets."""

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.assets.land.blocks import Block, Frontage
from simbev_ros.assets.land.covers import PATH_RISE_M
from simbev_ros.assets.land.fencing import fence_line
from simbev_ros.assets.land.parking import MODULE_M, parking_lot
from simbev_ros.assets.land.planting import random_positions, scatter
from simbev_ros.assets.land.rows import Site, build_rows
from simbev_ros.assets.land.yard import ENTRANCE_M, Yard, quad
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.palette import pick_color
from simbev_ros.assets.street.yard_things import container, dumpster, pallets, trailer
from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.geometry.plan_view import left_of
from simbev_ros.foundation.random import stream

_VERGE_M, _YARD_M = 2.6, 46.0
_GATE_SPACING_M, _GATE_M = 55.0, 9.0
_M2_PER_PLANT, _M2_PER_CONTAINER = 420.0, 900.0


def lay_out_industry(yard: Yard, block: Block) -> None:
    """Lay out an industrial block."""
    rng = yard.ground.stream(f"industry.{block.name}")
    front = overlay.difference(yard.near_streets(_YARD_M), shapely.buffer(yard.fast, _YARD_M, quad_segs=4))
    paved = overlay.intersection(overlay.difference(block.land, yard.near_streets(_VERGE_M)), front)
    yard.cover(overlay.difference(block.land, paved), "lawn", block.recipe.plants)
    # The same paving all over a map, because the border of a region may run through a yard.
    is_asphalt = stream(yard.ground.network.seed, "industry.paving").random() < 0.6
    yard.cover(paved, "asphalt" if is_asphalt else "concrete")
    for line in block.frontage:
        _put_gates(yard, block, line, rng)
    sites = build_rows(yard, block, _kind, rng)
    for site in sites:
        _fill_yard(yard, block, site, rng)
    _put_parking(yard, block, rng)
    _scatter_stock(yard, paved, block.recipe.furniture_density, rng)
    if block.recipe.plant_density > 0.0:
        green = overlay.difference(block.land.buffer(-1.0), paved)
        scatter(yard, green, _M2_PER_PLANT / block.recipe.plant_density, block.recipe.plants, "garden", rng)


def _kind(height_m: float, rng: np.random.Generator) -> str:
    return ("hall", "hall", "warehouse", "warehouse", "tanks")[int(rng.integers(5))]


def _put_gates(yard: Yard, block: Block, line: Frontage, rng: np.random.Generator) -> None:
    """Driveways across the verge, and fences between them."""
    gates = np.arange(_GATE_SPACING_M / 2.0, line.length_m - _GATE_M, _GATE_SPACING_M)
    fenced, edges = rng.random() < 1.4 * block.recipe.fence_density, [0.0]
    for at_m in gates.tolist():
        position_m, along = line.chord(at_m, _GATE_M)
        drive = quad(position_m, along, (0.0, _GATE_M), (-0.3, _VERGE_M + 0.6))
        yard.cover(overlay.intersection(drive, block.land), "concrete", rise_m=PATH_RISE_M)
        yard.claims.add(drive)
        yard.entrances.append(quad(position_m, along, (0.0, _GATE_M), (-ENTRANCE_M, 0.0)))
        edges += [at_m, at_m + _GATE_M]
    edges.append(line.length_m)
    for start_m, end_m in zip(edges[::2], edges[1::2], strict=True):
        if fenced and end_m - start_m > 3.0:
            position_m, along = line.chord(start_m, end_m - start_m)
            inset_m = left_of(along) * (_VERGE_M - 0.7)
            fence_line(
                yard, "bars", position_m + inset_m, position_m + inset_m + along * (end_m - start_m), block.land, rng
            )


def _fill_yard(yard: Yard, block: Block, site: Site, rng: np.random.Generator) -> None:
    """Trailers at the docks, a waste container and pallets along the front."""
    share, half_m = block.recipe.furniture_density, site.plot.width_m / 2.0
    for x_m in np.arange(4.0 - half_m, half_m - 9.0, 7.0):
        if site.kind == "warehouse" and rng.random() < 0.7 * share:
            _put_thing(
                yard, block, trailer(pick_color(rng, "trailers", 0.0)), site, (x_m, -8.2), (12.2, 2.6), -np.pi / 2
            )
    x_m = rng.uniform(-0.3, 0.3) * site.plot.width_m
    if rng.random() < share:
        _put_thing(yard, block, dumpster(pick_color(rng, "bins", 0.0)), site, (x_m, -2.6), (1.4, 2.0), np.pi / 2)
    if rng.random() < share:
        _put_thing(yard, block, pallets(), site, (x_m + 4.0, -2.4), (1.4, 1.0), 0.0)


def _put_thing(
    yard: Yard,
    block: Block,
    mesh: Mesh,
    site: Site,
    at_m: tuple[float, float],
    size_m: tuple[float, float],
    turn_rad: float,
) -> None:
    """Put an object at a position in a building's frame, turned relative to its front, if there is room for it."""
    length_m, width_m = size_m if turn_rad == 0.0 else size_m[::-1]
    x_m, y_m = at_m
    footprint = site.quad((x_m - length_m / 2.0, x_m + length_m / 2.0), (y_m - width_m / 2.0, y_m + width_m / 2.0))
    if yard.claim(footprint, block.land):
        yard.ensemble.put(mesh, site.map_point(x_m, y_m), site.yaw_rad + turn_rad)


def _put_parking(yard: Yard, block: Block, rng: np.random.Generator) -> None:
    """Parking lots beside the buildings, where there is room along a street."""
    for line in block.frontage:
        for at_m in np.arange(4.0, line.length_m - 32.0, 24.0):
            position_m, along = line.chord(float(at_m), 30.0)
            if rng.random() < 0.5 and parking_lot(
                yard, position_m + left_of(along) * (_VERGE_M + 1.5), along, 30.0, MODULE_M + 1.6, block.land
            ):
                break


def _scatter_stock(yard: Yard, paved: BaseGeometry, share: float, rng: np.random.Generator) -> None:
    """Containers scattered over the yards."""
    for position_m in random_positions(paved, _M2_PER_CONTAINER / max(share, 0.05), rng):
        yaw_rad = float(rng.uniform(0.0, np.pi))
        along = np.array([np.cos(yaw_rad), np.sin(yaw_rad)])
        if yard.claim(quad(position_m, along, (-3.3, 3.3), (-1.5, 1.5)), paved):
            yard.ensemble.put(container(pick_color(rng, "containers", 0.0)), position_m, yaw_rad)
