"""Detached houses with garages, porches and cross gables. Frame and conventions as in ``facades``."""

import numpy as np

from simbev_ros.assets.architecture.facades import (
    BAY_M,
    Band,
    body,
    built,
    door,
    door_x_m,
    gate,
    moved,
    plinth,
    rectangle,
)
from simbev_ros.assets.architecture.plot import Plot
from simbev_ros.assets.architecture.roofs import chimney, cross_gable, gabled_roof, hipped_roof
from simbev_ros.assets.architecture.walls import Wall
from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.mesh.primitives import box, boxes
from simbev_ros.assets.palette import Color, pick_color, shaded

GARAGE_M = 4.2
"""Width of a house's garage, part of its plot's width."""

_STOREY_M = 2.8
_GARAGE_BACK_M, _GARAGE_DEPTH_M, _GARAGE_EAVES_M = 1.2, 6.0, 2.5
_PORCH_M = 1.7


def villa(plot: Plot, wall: Wall, rng: np.random.Generator) -> Mesh:
    """A detached family house, one or two storeys."""
    roof, trim = pick_color(rng, "pitched_roofs"), pick_color(rng, "trims")
    width_m = house_width_m(plot)
    storeys = 1 + (plot.height_m > 4.5)
    plan = rectangle(width_m, plot.depth_m)
    mesh, eaves_m = body(plan, [Band(wall.material, wall.color, _STOREY_M, storeys)], roof)
    pitch = rng.uniform(0.45, 0.85)
    gabled = rng.random() < 0.6
    cover = gabled_roof(width_m, plot.depth_m, eaves_m, pitch, roof, wall, 0.35)
    pieces = [mesh, plinth(plan, plot.foundation_m)]
    pieces.append(cover if gabled else hipped_roof(width_m, plot.depth_m, eaves_m, pitch, roof))
    pieces += _front(plot, wall, eaves_m, (pitch, roof, trim), rng)
    ridge_m = eaves_m + pitch * min(width_m, plot.depth_m) / 2.0
    pieces.append(chimney(rng.uniform(-0.3, 0.3) * width_m, plot.depth_m * 0.6, eaves_m, ridge_m + 0.8, (138, 78, 62)))
    pieces.append(_back_door(width_m, plot, trim))
    house = moved(Mesh.merged(pieces), house_x_m(plot), 0.0)
    return Mesh.merged([house, _garage(plot, wall, (pitch * gabled, roof, trim), rng)]) if plot.garage else house


def house_width_m(plot: Plot) -> float:
    """Width of the house itself."""
    return plot.width_m - GARAGE_M * abs(plot.garage)


def house_x_m(plot: Plot) -> float:
    """Middle of the house itself; its garage is beside it."""
    return -plot.garage * GARAGE_M / 2.0


def garage_x_m(plot: Plot) -> float:
    """Middle of the garage."""
    return plot.garage * (plot.width_m - GARAGE_M) / 2.0


def _front(
    plot: Plot, wall: Wall, eaves_m: float, style: tuple[float, Color, Color], rng: np.random.Generator
) -> list[Mesh]:
    """Front door with a porch, and beside it perhaps a wing with a gable to the street."""
    pitch, roof, trim = style
    width_m = house_width_m(plot)
    door_m = door_x_m(width_m)
    pieces = door(door_m, pick_color(rng, "doors"), trim, plot.foundation_m, canopy=False)
    if width_m >= 3 * BAY_M and rng.random() < 0.6:
        wing_m, out_m = BAY_M, 1.1
        x_m = wing_m / 2.0 - width_m / 2.0
        plan = rectangle(wing_m, out_m + 2.0)
        mesh, top_m = body(plan, [Band(wall.material, wall.color, _STOREY_M, round(eaves_m / _STOREY_M))], roof)
        wing = [mesh, plinth(plan, plot.foundation_m), cross_gable(wing_m, out_m + 4.0, top_m, pitch, roof, wall)]
        pieces += [moved(piece, x_m, -out_m) for piece in wing]
    return [*pieces, *_porch(door_m, plot.foundation_m, roof, trim)]


def _porch(x_m: float, foundation_m: float, roof: Color, trim: Color) -> list[Mesh]:
    """A floor, two posts and a small roof before the door."""
    deck_m = 0.12 + foundation_m
    posts = np.array([[x_m - 1.15, 0.12 - _PORCH_M, 1.3], [x_m + 1.15, 0.12 - _PORCH_M, 1.3]])
    cover = cross_gable(2.6, _PORCH_M, 2.6, 0.35, roof, Wall("plaster", Material.FACADE, trim), 0.1)
    return [
        box(
            built(Material.CONCRETE, (150, 147, 140)), (2.6, _PORCH_M, deck_m), (x_m, -_PORCH_M / 2, 0.12 - deck_m / 2)
        ),
        boxes(built(Material.WOOD, trim), np.tile((0.14, 0.14, 2.6), (2, 1)), posts),
        moved(cover, x_m, -_PORCH_M),
    ]


def _back_door(width_m: float, plot: Plot, trim: Color) -> Mesh:
    """A glazed door to the back garden, with a step."""
    x_m, y_m = -width_m / 4.0, plot.depth_m
    return Mesh.merged(
        [
            box(built(Material.PLASTER, trim), (2.3, 0.1, 2.35), (x_m, y_m + 0.01, 1.175)),
            box(built(Material.GLASS, (58, 70, 76)), (2.0, 0.1, 2.1), (x_m, y_m + 0.03, 1.15)),
            box(
                built(Material.CONCRETE, (150, 147, 140)),
                (2.6, 0.6, 0.1 + plot.foundation_m),
                (x_m, y_m + 0.3, 0.05 - plot.foundation_m / 2),
            ),
        ]
    )


def _garage(plot: Plot, wall: Wall, style: tuple[float, Color, Color], rng: np.random.Generator) -> Mesh:
    """A garage beside the house, set back a little; its roof pitched as the house's, or flat where that is 0."""
    pitch, roof, trim = style
    width_m = GARAGE_M - 0.1
    plan = rectangle(width_m, _GARAGE_DEPTH_M)
    mesh, eaves_m = body(plan, [Band(wall.material, wall.color, _GARAGE_EAVES_M, 1)], roof)
    pieces = [mesh, plinth(plan, plot.foundation_m)]
    pieces += gate(0.0, 2.7, 2.15, shaded(pick_color(rng, "garage_doors"), 1.0), trim)
    if pitch > 0.0:
        pieces.append(cross_gable(width_m, _GARAGE_DEPTH_M, eaves_m, min(pitch, 0.6), roof, wall, 0.2))
    else:
        pieces.append(box(built(Material.ROOF, roof), (width_m + 0.3, _GARAGE_DEPTH_M + 0.3, 0.24), _over(eaves_m)))
    return moved(Mesh.merged(pieces), garage_x_m(plot), _GARAGE_BACK_M)


def _over(eaves_m: float) -> tuple[float, float, float]:
    """Centre of a garage's flat roof."""
    return 0.0, _GARAGE_DEPTH_M / 2.0, eaves_m + 0.1
