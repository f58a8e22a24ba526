"""Lays out downtown and residential blocks: rows of buildings, paved yards, front gardens, courtyards."""

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.assets.architecture.facades import door_x_m
from simbev_ros.assets.land.blocks import Block
from simbev_ros.assets.land.covers import PATH_RISE_M
from simbev_ros.assets.land.fencing import fence_line
from simbev_ros.assets.land.parking import DRIVE_M, MODULE_M, add_drive, parking_lot
from simbev_ros.assets.land.parks import lay_out_park
from simbev_ros.assets.land.planting import scatter
from simbev_ros.assets.land.rows import Site, build_rows
from simbev_ros.assets.land.yard import Yard, yaw_of
from simbev_ros.assets.palette import pick_color
from simbev_ros.assets.street.yard_things import dumpster
from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.geometry.plan_view import left_of

_MAX_HOUSE_HEIGHT_M, _MAX_APARTMENTS_HEIGHT_M = 7.5, 24.0
_YARD_DEPTH_M = 27.0
_PARK_SHARE, _MAX_PARK_M2 = 0.13, 30_000.0
_HOUSES, _TERRACE_SHARE = ("town_house", "terrace"), 0.6
_PATH_M, _GATE_M, _MIN_BARRIER_M = 1.3, 1.1, 1.5
_FRONT_BARRIERS = ("hedge", "picket", "railed_wall", "railed_wall", "railing", "railing", "low_wall")
_DRIVE_SHARE, _DRIVE_SHARE_OF_DEPTH, _BESIDE_HOUSE_M = 0.8, 0.6, 0.55
_GARDEN_M2, _COURT_M2, _PLAZA_M2 = 330.0, 330.0, 260.0
_MAX_COURT_M2 = 40_000.0


def lay_out_town(yard: Yard, block: Block) -> None:
    """Lay out a downtown or residential block; some residential blocks become parks."""
    rng = yard.ground.stream(f"town.{block.name}")
    downtown = block.recipe.use == "downtown"
    if not downtown and block.frontage and block.land.area < _MAX_PARK_M2 and rng.random() < _PARK_SHARE:
        lay_out_park(yard, block)
        return
    court = _court(yard, block, _YARD_DEPTH_M) if downtown else block.land
    yard.cover(court, "lawn", block.recipe.plants)
    yard.cover(overlay.difference(block.land, court), "yard")
    choose = _downtown_kind if downtown else _residential_kind
    sites = build_rows(yard, block, choose, rng, density=block.recipe.building_density ** (0.4 if downtown else 1.0))
    _pave_fronts(yard, block, sites)
    _pave_drives(yard, block, sites)
    for site in sites:
        if site.kind in _HOUSES:
            _fence_in(yard, block, site, rng)
        elif rng.random() < block.recipe.furniture_density:
            _put_waste(yard, block, site, rng)
    if downtown and block.land.area < _MAX_COURT_M2 and rng.random() < 0.5:
        _court_parking(yard, block, rng)
    density = block.recipe.plant_density
    if density > 0.0:
        green, m2_per_plant = (court, _COURT_M2) if downtown else (block.land.buffer(-1.2), _GARDEN_M2)
        scatter(yard, green, m2_per_plant / density, block.recipe.plants, "garden", rng)
        if downtown:
            plaza = overlay.difference(block.land.buffer(-1.5), court)
            scatter(yard, plaza, _PLAZA_M2 / density, block.recipe.plants, "street", rng)


def _court(yard: Yard, block: Block, depth_m: float) -> BaseGeometry:
    """The land that is further than a depth from streets."""
    return overlay.difference(block.land, yard.near_streets(depth_m))


def _downtown_kind(height_m: float, rng: np.random.Generator) -> str:
    if height_m > _MAX_APARTMENTS_HEIGHT_M:
        return "office"
    return "shop" if height_m < _MAX_HOUSE_HEIGHT_M else "apartments"


def _residential_kind(height_m: float, rng: np.random.Generator) -> str:
    if height_m > _MAX_APARTMENTS_HEIGHT_M:
        return "office"
    if height_m < _MAX_HOUSE_HEIGHT_M + 3.0 * rng.random():
        draw = rng.random()
        return "terrace" if draw < _TERRACE_SHARE else "town_house" if draw < 0.85 else "shop"
    return "church" if rng.random() < 0.02 else "apartments"


def _pave_fronts(yard: Yard, block: Block, sites: list[Site]) -> None:
    """Paving from the sidewalk to the front: a path to the door of a house, a forecourt for other buildings."""
    paths = []
    for site in sites:
        half_m = site.plot.width_m / 2.0
        x_m = door_x_m(site.plot.width_m)
        house = site.kind in _HOUSES
        span_m = (x_m - _PATH_M / 2.0, x_m + _PATH_M / 2.0) if house else (-half_m, half_m)
        paths.append(site.quad(span_m, (site.street_m - 0.3, 0.0)))
        if house:
            yard.claims.add(paths[-1].buffer(0.2))
    if block.recipe.use != "downtown":
        yard.cover(overlay.intersection(overlay.union_all(paths), block.land), "yard", rise_m=PATH_RISE_M)


def _pave_drives(yard: Yard, block: Block, sites: list[Site]) -> None:
    """Drives beside houses, where the gap to the next one is wide enough."""
    rng, drives = yard.ground.stream(f"drives.{block.name}"), []
    for site in sites:
        x_m = rng.choice([-1.0, 1.0]) * (site.plot.width_m / 2.0 + _BESIDE_HOUSE_M + DRIVE_M / 2.0)
        span_m, end_m = (x_m - DRIVE_M / 2.0, x_m + DRIVE_M / 2.0), _DRIVE_SHARE_OF_DEPTH * site.plot.depth_m
        is_wanted = site.kind == "town_house" and rng.random() < _DRIVE_SHARE
        if is_wanted and yard.claim(site.quad(span_m, (site.street_m + 0.1, end_m)), block.land):
            drives.append(site.quad(span_m, (site.street_m - 0.3, end_m)))
            add_drive(yard, site, x_m, end_m)
    yard.cover(overlay.intersection(overlay.union_all(drives), block.land), "drive", rise_m=PATH_RISE_M)


def _fence_in(yard: Yard, block: Block, site: Site, rng: np.random.Generator) -> None:
    """A hedge, a fence or a wall along the front of a house's garden, open at the path."""
    kind = _FRONT_BARRIERS[int(rng.integers(len(_FRONT_BARRIERS)))]
    if rng.random() > 2.0 * block.recipe.fence_density:
        return
    y_m = site.street_m + (0.3 if site.kind == "terrace" else 0.55)
    door_m, half_m = door_x_m(site.plot.width_m), site.plot.width_m / 2.0 + (0.0 if site.kind == "terrace" else 0.5)
    for start_m, end_m in ((-half_m, door_m - _GATE_M), (door_m + _GATE_M, half_m)):
        if end_m - start_m > _MIN_BARRIER_M:
            fence_line(yard, kind, site.map_point(start_m, y_m), site.map_point(end_m, y_m), block.land, rng)


def _put_waste(yard: Yard, block: Block, site: Site, rng: np.random.Generator) -> None:
    """A waste container behind a building."""
    position_m = site.map_point(rng.uniform(-0.3, 0.3) * site.plot.width_m, site.plot.depth_m + 1.7)
    if yard.claim(shapely.Point(position_m).buffer(1.1, quad_segs=3), block.land):
        color = pick_color(rng, "bins", 0.0)
        yard.ensemble.put(dumpster(color), position_m, yaw_of(site.along) + np.pi / 2.0)


def _court_parking(yard: Yard, block: Block, rng: np.random.Generator) -> None:
    """A parking lot in the middle of a large block."""
    court = _court(yard, block, _YARD_DEPTH_M - 6.0)
    if court.is_empty or not block.frontage:
        return
    longest = max(block.frontage, key=lambda line: line.length_m)
    _, along = longest.chord(0.0, longest.length_m)
    middle = np.array(court.centroid.coords[0])
    across = left_of(along)
    for width_m in (52.0, 40.0, 29.0, 19.0):
        depth_m = MODULE_M + 1.6
        origin_m = middle - along * width_m / 2.0 - across * depth_m / 2.0
        if parking_lot(yard, origin_m, along, width_m, depth_m, court):
            return
