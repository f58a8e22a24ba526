"""Lays out suburban blocks: detached houses with garages and driveways, hedges and fences, back gardens."""

from itertools import pairwise

import numpy as np
import shapely

from simbev_ros.assets.architecture.facades import door_x_m
from simbev_ros.assets.architecture.houses import garage_x_m, house_width_m, house_x_m
from simbev_ros.assets.land.blocks import Block
from simbev_ros.assets.land.covers import PATH_RISE_M
from simbev_ros.assets.land.fencing import fence_line
from simbev_ros.assets.land.parking import DRIVE_M, add_drive
from simbev_ros.assets.land.planting import scatter
from simbev_ros.assets.land.rows import Site, build_rows
from simbev_ros.assets.land.yard import Yard
from simbev_ros.assets.palette import pick_color
from simbev_ros.assets.street.furniture import mailbox
from simbev_ros.assets.street.yard_things import wheelie_bin, wood_pile
from simbev_ros.foundation.geometry import overlay

_PATH_M = 1.2
_AT_GATE_M = 0.7
_GARDEN_DEPTH_M = 14.0
_M2_PER_PLANT = 95.0
_SIDE_M = 2.6
_FRONT_BARRIERS = ("hedge", "picket", "low_wall", "railed_wall", "railing", "picket")
_BACK_BARRIERS = ("boards", "high_hedge", "picket")


def lay_out_suburb(yard: Yard, block: Block) -> None:
    """Lay out a block of detached houses, with an occasional school or church."""
    rng = yard.ground.stream(f"suburb.{block.name}")
    yard.cover(block.land, "lawn", block.recipe.plants)
    sites = build_rows(yard, block, _kind, rng)
    shapely.prepare(block.land)
    paths = [path for site in sites for path in _claim_paths(yard, site)]
    yard.cover(overlay.intersection(overlay.union_all(paths), block.land), "drive", rise_m=PATH_RISE_M)
    for site in sites:
        if site.kind == "villa":
            _garden(yard, block, site, rng)
    if block.recipe.plant_density > 0.0:
        area = block.land.buffer(-1.2)
        scatter(yard, area, _M2_PER_PLANT / block.recipe.plant_density, block.recipe.plants, "garden", rng)


def _kind(height_m: float, rng: np.random.Generator) -> str:
    draw = rng.random()
    return "villa" if draw > 0.012 else ("church" if draw < 0.005 else "school")


def _claim_paths(yard: Yard, site: Site) -> list[shapely.Polygon]:
    """Claim the driveway and the path to the door; returns their areas."""
    front_m = site.street_m - 0.3
    door_m = door_x_m(house_width_m(site.plot)) + house_x_m(site.plot)
    paths = [site.quad((door_m - _PATH_M / 2.0, door_m + _PATH_M / 2.0), (front_m, -0.3))]
    if site.kind != "villa":
        paths = [site.quad((-2.5, 2.5), (front_m, -0.3))]
    elif site.plot.garage:
        x_m = garage_x_m(site.plot)
        paths.append(site.quad((x_m - DRIVE_M / 2.0, x_m + DRIVE_M / 2.0), (front_m, 1.2)))
        add_drive(yard, site, x_m, _AT_GATE_M)
    yard.claims.add(*paths)
    return paths


def _garden(yard: Yard, block: Block, site: Site, rng: np.random.Generator) -> None:
    """Barriers around a plot, a mailbox at its gate, bins beside the house."""
    half_m, depth_m = site.plot.width_m / 2.0 + _SIDE_M, site.plot.depth_m + _GARDEN_DEPTH_M
    edge_m = site.street_m
    if rng.random() < 1.5 * block.recipe.fence_density:
        kind = _FRONT_BARRIERS[int(rng.integers(len(_FRONT_BARRIERS)))]
        fence_line(
            yard, kind, site.map_point(-half_m, edge_m + 0.7), site.map_point(half_m, edge_m + 0.7), block.land, rng
        )
    if rng.random() < 1.3 * block.recipe.fence_density:
        kind = _BACK_BARRIERS[int(rng.integers(len(_BACK_BARRIERS)))]
        corners = [
            site.map_point(x, y) for x, y in ((-half_m, 2.0), (-half_m, depth_m), (half_m, depth_m), (half_m, 2.0))
        ]
        for start_m, end_m in pairwise(corners):
            fence_line(yard, kind, start_m, end_m, block.land, rng)
    furnished = block.recipe.furniture_density
    things = (
        (mailbox(), rng.choice([-1.0, 1.0]) * 1.1 + house_x_m(site.plot), edge_m + 0.8, 0.35, -np.pi / 2.0),
        (wheelie_bin(pick_color(rng, "bins", 0.0)), 0.5 - half_m + 1.3, 3.0, 0.45, np.pi),
        (wood_pile(), 0.0, site.plot.depth_m + 2.6, 1.7, 0.0),
    )
    for (mesh, x_m, y_m, room_m, turn_rad), share in zip(things, (1.2, 1.0, 0.3), strict=True):
        position_m = site.map_point(x_m, y_m)
        if rng.random() < share * furnished and yard.claim(
            shapely.Point(position_m).buffer(room_m, quad_segs=2), block.land
        ):
            yard.ensemble.put(mesh, position_m, site.yaw_rad + turn_rad)
