"""Buildings: a plot and a style in, one closed mesh out. Frame and conventions as in ``facades``."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import shapely

from simbev_ros.assets.facades import (
    BAY_M,
    FOUNDATION_M,
    Band,
    awning,
    balconies,
    body,
    built,
    door,
    door_x_m,
    ledge,
    pilasters,
    rectangle,
)
from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh import Mesh
from simbev_ros.assets.palette import Color, pick_color, shaded
from simbev_ros.assets.primitives import box
from simbev_ros.assets.roofs import chimney, flat_roof, gabled_roof, hipped_roof

_SHOP_STOREY_M = 3.9
_OFFICE_STOREY_M = 3.5
_HOUSE_STOREY_M = 2.9


@dataclass(frozen=True, slots=True)
class Plot:
    """Room for a building: width along the street, depth, and its wanted height at the eaves, metres."""

    width_m: float
    depth_m: float
    height_m: float


def house(plot: Plot, rng: np.random.Generator, wall: str) -> Mesh:
    """A small house: one or two storeys, pitched roof, chimney, front door."""
    color, roof = pick_color(rng, f"walls.{wall}"), pick_color(rng, "pitched_roofs")
    trim = pick_color(rng, "trims")
    storeys = int(np.clip(round(plot.height_m / _HOUSE_STOREY_M), 1, 2))
    plan = rectangle(plot.width_m, plot.depth_m)
    mesh, eaves_m = body(plan, [Band(Material.FACADE, color, _HOUSE_STOREY_M, storeys)], roof)
    pitch = rng.uniform(0.55, 0.95)
    pieces = [mesh, _plinth(plan), *door(door_x_m(plot.width_m), pick_color(rng, "doors"), trim)]
    if rng.random() < 0.65:
        pieces.append(gabled_roof(plot.width_m, plot.depth_m, eaves_m, pitch, roof, (_plain(wall), color), 0.3))
    else:
        pieces.append(hipped_roof(plot.width_m, plot.depth_m, eaves_m, pitch, roof))
    ridge_m = eaves_m + pitch * min(plot.width_m, plot.depth_m) / 2.0
    stack = (rng.uniform(-0.2, 0.2) * plot.width_m, plot.depth_m * rng.uniform(0.5, 0.6))
    pieces.append(chimney(*stack, eaves_m, ridge_m + 0.9, (138, 78, 62)))
    return Mesh.merged(pieces)


def apartments(plot: Plot, rng: np.random.Generator, wall: str) -> Mesh:
    """A town house of three to seven storeys, often with shops; cornice and flat roof, or a gabled one."""
    color, trim = pick_color(rng, f"walls.{wall}"), pick_color(rng, "trims")
    shops = rng.random() < 0.55
    storeys = int(np.clip(round(plot.height_m / 3.1), 3, 8)) - shops
    plan = rectangle(plot.width_m, plot.depth_m)
    upper = Band(Material.FACADE, color, 3.1, storeys)
    bands = [_shop_band(rng), upper] if shops else [upper]
    pitched = storeys < 6 and rng.random() < 0.45
    roof = pick_color(rng, "pitched_roofs" if pitched else "flat_roofs")
    mesh, eaves_m = body(plan, bands, roof)
    first_m = _SHOP_STOREY_M if shops else 3.1
    pieces = [mesh, _plinth(plan), ledge(plan, trim, first_m - 0.15, 0.3, 0.14)]
    if rng.random() < 0.35:
        pieces += pilasters(plot.width_m, shaded(color, 0.9), first_m, eaves_m)
    elif rng.random() < 0.6:
        pieces += _balcony_stacks(rng, plot.width_m, first_m, eaves_m, trim)
    pieces += _street_floor(rng, plot.width_m, trim, shops)
    if pitched:
        pitch = rng.uniform(0.5, 0.8)
        pieces.append(gabled_roof(plot.width_m, plot.depth_m, eaves_m, pitch, roof, (_plain(wall), color)))
        ridge_m = eaves_m + pitch * plot.depth_m / 2.0
        pieces += [chimney(s * plot.width_m * 0.3, plot.depth_m * 0.55, eaves_m, ridge_m + 0.8, color) for s in (-1, 1)]
    else:
        pieces.append(ledge(plan, trim, eaves_m - 0.55, 0.5, 0.35))
        pieces += flat_roof(rng, plot.width_m, plot.depth_m, eaves_m, trim)
    return Mesh.merged(pieces)


def office(plot: Plot, rng: np.random.Generator, wall: str) -> Mesh:
    """A tall block: shops or lobby below, curtain wall or windows above, sometimes a tower that steps back."""
    glass = wall == "glass" or rng.random() < 0.7
    color = pick_color(rng, "walls.glass" if glass else f"walls.{wall}")
    upper, trim = Material.OFFICE_GLASS if glass else Material.FACADE, pick_color(rng, "frames")
    storeys = max(4, round((plot.height_m - _SHOP_STOREY_M) / _OFFICE_STOREY_M))
    plan = rectangle(plot.width_m, plot.depth_m)
    steps_back = storeys > 8 and plot.width_m >= 5 * BAY_M and rng.random() < 0.6
    below = storeys // 3 if steps_back else storeys
    roof = pick_color(rng, "flat_roofs")
    mesh, top_m = body(plan, [_shop_band(rng), Band(upper, color, _OFFICE_STOREY_M, below)], roof)
    pieces = [
        mesh,
        _plinth(plan),
        ledge(plan, trim, _SHOP_STOREY_M - 0.25, 0.5, 0.2),
        ledge(plan, trim, top_m - 0.44, 0.4, 0.12),
    ]
    pieces += _fins(plan, trim, _SHOP_STOREY_M + 0.25, top_m) if rng.random() < 0.6 else []
    width_m, depth_m = plot.width_m, plot.depth_m
    if steps_back:
        plan = plan.buffer(-BAY_M / 2.0, join_style="mitre")
        tower, top_m = body(plan, [Band(upper, color, _OFFICE_STOREY_M, storeys - below)], roof, base_m=top_m)
        pieces += [tower, ledge(plan, trim, top_m - 0.44, 0.4, 0.12)]
    crown = flat_roof(rng, width_m - BAY_M * steps_back, depth_m - BAY_M * steps_back, top_m, trim)
    shift = np.eye(4)
    shift[1, 3] = BAY_M / 2.0 * steps_back
    return Mesh.merged([*pieces, *(piece.transformed(shift) for piece in crown)])


def shop(plot: Plot, rng: np.random.Generator, wall: str) -> Mesh:
    """A low shop or restaurant: display windows, awnings, flat roof; sometimes a storey above."""
    color, trim = pick_color(rng, f"walls.{wall}"), pick_color(rng, "trims")
    plan = rectangle(plot.width_m, plot.depth_m)
    bands = [_shop_band(rng)]
    if plot.height_m > 7.0:
        bands.append(Band(Material.FACADE, color, 3.0, 1))
    mesh, roof_m = body(plan, bands, pick_color(rng, "flat_roofs"))
    sign = box(
        built(Material.PLASTIC, pick_color(rng, "awnings")), (plot.width_m * 0.5, 0.14, 0.7), (0.0, -0.05, roof_m + 0.4)
    )
    pieces = [mesh, _plinth(plan), sign, *_street_floor(rng, plot.width_m, trim, shops=True)]
    return Mesh.merged(
        [*pieces, *flat_roof(rng, plot.width_m, plot.depth_m, roof_m, color if rng.random() < 0.5 else trim)]
    )


Style = Callable[[Plot, np.random.Generator, str], Mesh]
STYLES: Mapping[str, Style] = {"house": house, "apartments": apartments, "office": office, "shop": shop}


def _plain(wall: str) -> Material:
    return Material.BRICK if wall == "brick" else Material.PLASTER


def _shop_band(rng: np.random.Generator) -> Band:
    return Band(Material.SHOPFRONT, pick_color(rng, "shops"), _SHOP_STOREY_M, 1)


def _plinth(plan: shapely.Polygon) -> Mesh:
    """The foot of the walls, reaching into the ground."""
    return ledge(plan, (112, 110, 106), -FOUNDATION_M, FOUNDATION_M + 0.25, 0.06)


def _street_floor(rng: np.random.Generator, width_m: float, trim: Color, shops: bool) -> list[Mesh]:
    """Awnings over the shops, or the front door."""
    if not shops:
        return door(door_x_m(width_m), pick_color(rng, "doors"), trim)
    if rng.random() < 0.4:
        return []
    color, count = pick_color(rng, "awnings"), max(1, round(width_m / (2 * BAY_M)))
    spots = (np.arange(count) + 0.5) / count * width_m - width_m / 2.0
    return [awning(float(x_m), width_m / count - 1.2, color, 3.1) for x_m in spots]


def _balcony_stacks(
    rng: np.random.Generator, width_m: float, first_m: float, eaves_m: float, trim: Color
) -> list[Mesh]:
    """Balconies one above the other on every other bay, or on the outer ones."""
    bays = max(1, round(width_m / BAY_M))
    chosen = range(0, bays, 2) if rng.random() < 0.5 else sorted({min(1, bays - 1), max(0, bays - 2)})
    return balconies(width_m, list(chosen), list(np.arange(first_m, eaves_m - 2.0, 3.1)), trim)


def _fins(plan: shapely.Polygon, color: Color, bottom_m: float, top_m: float) -> list[Mesh]:
    """Slender uprights on the front and the back of a curtain wall."""
    left_m, near_m, right_m, far_m = plan.bounds
    count, height_m = max(1, round((right_m - left_m) / BAY_M)), top_m - bottom_m
    return [
        box(built(Material.METAL, color), (0.12, 0.3, height_m), (float(x_m), y_m, bottom_m + height_m / 2.0))
        for x_m in np.linspace(left_m + 0.06, right_m - 0.06, count + 1)
        for y_m in (near_m - 0.1, far_m + 0.1)
    ]
