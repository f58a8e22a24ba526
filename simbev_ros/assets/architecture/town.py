"""Buildings of towns: row houses, apartments, offices, shops. Frame and conventions as in ``facades``."""

import numpy as np
import shapely

from simbev_ros.assets.architecture.facades import (
    BAY_M,
    Band,
    awning,
    balconies,
    body,
    building_finish,
    door,
    door_x_m,
    ledge,
    move_mesh,
    pilasters,
    plinth,
    rectangle,
)
from simbev_ros.assets.architecture.plot import Plot
from simbev_ros.assets.architecture.roofs import chimney, cross_gable, flat_roof, gabled_roof, hipped_roof
from simbev_ros.assets.architecture.walls import Wall
from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.mesh.primitives import box, boxes
from simbev_ros.assets.palette import Color, pick_color, shade_color

_SHOP_STORY_M = 3.9
_OFFICE_STORY_M = 3.5
_HOUSE_STORY_M = 2.9
_TALL_TERRACE_M, _TERRACE_PITCH = 7.8, 0.75
_FLAT_STORY_M = 3.1


def town_house(plot: Plot, wall: Wall, rng: np.random.Generator) -> Mesh:
    """Build a small house: one or two stories, pitched roof, chimney, front door."""
    roof, trim = pick_color(rng, "pitched_roofs"), pick_color(rng, "trims")
    stories = int(np.clip(round(plot.height_m / _HOUSE_STORY_M), 1, 2))
    plan = rectangle(plot.width_m, plot.depth_m)
    mesh, eaves_m = body(plan, [Band(wall.material, wall.color, _HOUSE_STORY_M, stories)], roof)
    pitch = rng.uniform(0.55, 0.95)
    pieces = [mesh, plinth(plan, plot.foundation_m)]
    pieces += door(door_x_m(plot.width_m), pick_color(rng, "doors"), trim, plot.foundation_m)
    if rng.random() < 0.65:
        pieces.append(gabled_roof(plot.width_m, plot.depth_m, eaves_m, pitch, roof, wall, 0.3))
    else:
        pieces.append(hipped_roof(plot.width_m, plot.depth_m, eaves_m, pitch, roof))
    ridge_m = eaves_m + pitch * min(plot.width_m, plot.depth_m) / 2.0
    stack = (rng.uniform(-0.2, 0.2) * plot.width_m, plot.depth_m * rng.uniform(0.5, 0.6))
    return Mesh.merge([*pieces, chimney(*stack, eaves_m, ridge_m + 0.9, (138, 78, 62))])


def terrace(plot: Plot, wall: Wall, rng: np.random.Generator) -> Mesh:
    """Build a house of a terrace: two or three stories, a bay window, a chimney with pots over the party wall."""
    roof, trim = pick_color(rng, "pitched_roofs"), pick_color(rng, "trims")
    plan, stories = rectangle(plot.width_m, plot.depth_m), 2 + (plot.height_m > _TALL_TERRACE_M)
    mesh, eaves_m = body(plan, [Band(wall.material, wall.color, _HOUSE_STORY_M, stories)], roof)
    pieces = [mesh, plinth(plan, plot.foundation_m)]
    pieces += door(door_x_m(plot.width_m), pick_color(rng, "doors"), trim, plot.foundation_m, canopy=rng.random() < 0.4)
    pieces.append(gabled_roof(plot.width_m, plot.depth_m, eaves_m, _TERRACE_PITCH, roof, wall))
    bay_x_m, floors = -plot.width_m / 4.0, int(rng.integers(3))
    if floors:
        bay = shapely.box(bay_x_m - 0.95, -0.65, bay_x_m + 0.95, 0.2)
        front, top_m = body(bay, [Band(wall.material, trim, _HOUSE_STORY_M, floors)], roof)
        pieces += [front, plinth(bay, plot.foundation_m), ledge(bay, trim, top_m - 0.1, 0.2, 0.1)]
    if rng.random() < 0.35:
        foot_m = eaves_m + 1.1 * _TERRACE_PITCH
        dormer, top_m = body(shapely.box(-0.9, 1.1, 0.9, 3.0), [Band(wall.material, trim, 1.5, 1)], roof, foot_m)
        pieces += [dormer, move_mesh(cross_gable(1.8, 2.6, top_m, 0.6, roof, wall, 0.1), 0.0, 1.0)]
    stack_m = (0.35 - plot.width_m / 2.0, plot.depth_m / 2.0)
    top_m = eaves_m + _TERRACE_PITCH * plot.depth_m / 2.0 + 1.2
    pieces.append(chimney(*stack_m, eaves_m, top_m, shade_color(wall.color, 0.85)))
    pots = np.array([(stack_m[0], stack_m[1] + y, top_m + 0.2) for y in (-0.2, 0.0, 0.2)])
    pieces.append(boxes(building_finish(Material.BRICK, (168, 98, 70)), np.tile((0.16, 0.14, 0.45), (3, 1)), pots))
    return Mesh.merge(pieces)


def apartments(plot: Plot, wall: Wall, rng: np.random.Generator) -> Mesh:
    """Build an apartment house of three to eight stories, often with shops; flat roof with a cornice, or gabled."""
    trim, shops = pick_color(rng, "trims"), rng.random() < 0.55
    stories = int(np.clip(round(plot.height_m / _FLAT_STORY_M), 3, 8)) - shops
    plan = rectangle(plot.width_m, plot.depth_m)
    upper = Band(wall.material, wall.color, _FLAT_STORY_M, stories)
    pitched = wall.style in ("brick", "plaster", "timber") and stories < 6 and rng.random() < 0.45
    roof = pick_color(rng, "pitched_roofs" if pitched else "flat_roofs")
    mesh, eaves_m = body(plan, [_shop_band(rng), upper] if shops else [upper], roof)
    first_m = _SHOP_STORY_M if shops else _FLAT_STORY_M
    pieces = [mesh, plinth(plan, plot.foundation_m), ledge(plan, trim, first_m - 0.15, 0.3, 0.14)]
    pieces += _front_relief(plot.width_m, wall, trim, first_m, eaves_m, rng)
    pieces += _street_floor(rng, plot, trim, shops)
    if pitched:
        pitch = rng.uniform(0.5, 0.8)
        pieces.append(gabled_roof(plot.width_m, plot.depth_m, eaves_m, pitch, roof, wall))
        ridge_m = eaves_m + pitch * plot.depth_m / 2.0 + 0.8
        x_m = plot.width_m * 0.3
        pieces += [chimney(x, plot.depth_m * 0.55, eaves_m, ridge_m, (138, 78, 62)) for x in (-x_m, x_m)]
    else:
        pieces.append(ledge(plan, trim, eaves_m - 0.55, 0.5, 0.35))
        pieces += flat_roof(rng, plot.width_m, plot.depth_m, eaves_m, trim)
    return Mesh.merge(pieces)


def office(plot: Plot, wall: Wall, rng: np.random.Generator) -> Mesh:
    """Build a tall block: shops or lobby below, curtain wall or windows above, sometimes a stepped-back tower."""
    trim = pick_color(rng, "frames")
    stories = max(4, round((plot.height_m - _SHOP_STORY_M) / _OFFICE_STORY_M))
    plan = rectangle(plot.width_m, plot.depth_m)
    steps_back = stories > 8 and plot.width_m >= 5 * BAY_M and rng.random() < 0.6
    below = stories // 3 if steps_back else stories
    roof = pick_color(rng, "flat_roofs")
    upper = Band(wall.material, wall.color, _OFFICE_STORY_M, below)
    mesh, top_m = body(plan, [_shop_band(rng), upper], roof)
    pieces = [
        mesh,
        plinth(plan, plot.foundation_m),
        ledge(plan, trim, _SHOP_STORY_M - 0.25, 0.5, 0.2),
        ledge(plan, trim, top_m - 0.44, 0.4, 0.12),
    ]
    pieces += [_fins(plan, trim, _SHOP_STORY_M + 0.25, top_m)] if rng.random() < 0.6 else []
    width_m, depth_m = plot.width_m, plot.depth_m
    if steps_back:
        plan = plan.buffer(-BAY_M / 2.0, join_style="mitre")
        upper = Band(wall.material, wall.color, _OFFICE_STORY_M, stories - below)
        tower, top_m = body(plan, [upper], roof, base_m=top_m)
        pieces += [tower, ledge(plan, trim, top_m - 0.44, 0.4, 0.12)]
        width_m, depth_m = width_m - BAY_M, depth_m - BAY_M
    crown = Mesh.merge(flat_roof(rng, width_m, depth_m, top_m, trim))
    return Mesh.merge([*pieces, move_mesh(crown, 0.0, BAY_M / 2.0 * steps_back)])


def shop(plot: Plot, wall: Wall, rng: np.random.Generator) -> Mesh:
    """Build a low shop or restaurant: display windows, awnings, flat roof; sometimes a story above."""
    trim = pick_color(rng, "trims")
    plan = rectangle(plot.width_m, plot.depth_m)
    bands = [_shop_band(rng)]
    if plot.height_m > 7.0:
        bands.append(Band(wall.material, wall.color, 3.0, 1))
    mesh, roof_m = body(plan, bands, pick_color(rng, "flat_roofs"))
    board = building_finish(Material.PLASTIC, pick_color(rng, "awnings"))
    sign = box(board, (plot.width_m * 0.5, 0.14, 0.7), (0.0, -0.05, roof_m + 0.4))
    pieces = [mesh, plinth(plan, plot.foundation_m), sign, *_street_floor(rng, plot, trim, shops=True)]
    crown = wall.color if rng.random() < 0.5 else trim
    return Mesh.merge([*pieces, *flat_roof(rng, plot.width_m, plot.depth_m, roof_m, crown)])


def _shop_band(rng: np.random.Generator) -> Band:
    return Band(Material.SHOPFRONT, pick_color(rng, "shops"), _SHOP_STORY_M, 1)


def _front_relief(
    width_m: float, wall: Wall, trim: Color, first_m: float, eaves_m: float, rng: np.random.Generator
) -> list[Mesh]:
    """Pilasters, columns of balconies, or nothing."""
    if wall.style != "concrete" and rng.random() < 0.35:
        return [pilasters(width_m, shade_color(wall.color, 0.9), first_m, eaves_m)]
    if rng.random() > 0.6:
        return []
    bays = max(1, round(width_m / BAY_M))
    chosen = range(0, bays, 2) if rng.random() < 0.5 else sorted({min(1, bays - 1), max(0, bays - 2)})
    return balconies(width_m, list(chosen), list(np.arange(first_m, eaves_m - 2.0, _FLAT_STORY_M)), trim)


def _street_floor(rng: np.random.Generator, plot: Plot, trim: Color, shops: bool) -> list[Mesh]:
    """Awnings over the shops, or the front door."""
    if not shops:
        return door(door_x_m(plot.width_m), pick_color(rng, "doors"), trim, plot.foundation_m)
    if rng.random() < 0.4:
        return []
    color, count = pick_color(rng, "awnings"), max(1, round(plot.width_m / (2 * BAY_M)))
    x_positions_m = (np.arange(count) + 0.5) / count * plot.width_m - plot.width_m / 2.0
    cloth = awning(plot.width_m / count - 1.2, color, 3.1)
    return [cloth.shift(float(x_m), 0.0, 0.0) for x_m in x_positions_m]


def _fins(plan: shapely.Polygon, color: Color, bottom_m: float, top_m: float) -> Mesh:
    """Slender vertical fins on the front and the back of a curtain wall."""
    left_m, near_m, right_m, far_m = plan.bounds
    count, height_m = max(1, round((right_m - left_m) / BAY_M)), top_m - bottom_m
    x_m = np.tile(np.linspace(left_m + 0.06, right_m - 0.06, count + 1), 2)
    y_m = np.repeat([near_m - 0.1, far_m + 0.1], count + 1)
    centers_m = np.column_stack([x_m, y_m, np.full(len(x_m), bottom_m + height_m / 2.0)])
    return boxes(building_finish(Material.METAL, color), np.tile((0.12, 0.3, height_m), (len(centers_m), 1)), centers_m)
