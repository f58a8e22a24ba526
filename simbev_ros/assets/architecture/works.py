"""Industrial buildings: halls, warehouses, tanks. Frame and conventions as in ``facades``."""

import numpy as np

from simbev_ros.assets.architecture.facades import (
    BAY_M,
    Band,
    body,
    built,
    door,
    gate,
    moved,
    parapet,
    plinth,
    rectangle,
    windowless,
)
from simbev_ros.assets.architecture.plot import Plot
from simbev_ros.assets.architecture.roofs import gabled_roof, roof_units
from simbev_ros.assets.architecture.walls import Wall
from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.mesh.primitives import box, boxes, cylinder, lathe
from simbev_ros.assets.palette import pick_color, shaded

_OFFICE_STOREY_M = 3.2
_GATE_SPACING_M = 7.0


def hall(plot: Plot, wall: Wall, rng: np.random.Generator) -> Mesh:
    """A workshop: blank sheet walls below a ribbon of windows, low gabled roof, gates to the street, an office."""
    roof, trim = pick_color(rng, "flat_roofs"), pick_color(rng, "signal_trims")
    plan = rectangle(plot.width_m, plot.depth_m)
    eaves_m = max(plot.height_m, 6.0)
    lower, _ = body(plan, [Band(wall.material, wall.color, eaves_m - 1.8, 1)], roof)
    ribbon, _ = body(plan, [Band(Material.METAL_FACADE, shaded(wall.color, 0.85), 1.8, 1)], roof, base_m=eaves_m - 1.8)
    cover = gabled_roof(plot.width_m, plot.depth_m, eaves_m, 0.18, roof, wall, 0.3, 0.3)
    pieces = [windowless(lower), ribbon, cover, plinth(plan, plot.foundation_m)]
    pieces += _gates(plot, rng, dock_m=0.0)
    stripe = built(Material.METAL, trim)
    pieces.append(box(stripe, (plot.width_m + 0.1, 0.12, 0.5), (0.0, -0.02, eaves_m - 2.1)))
    pieces.append(_office(plot, rng, wall))
    return Mesh.merged(pieces)


def warehouse(plot: Plot, wall: Wall, rng: np.random.Generator) -> Mesh:
    """A flat-roofed box of panels with a row of loading docks along the street, and an office at one end."""
    roof, trim = pick_color(rng, "flat_roofs"), pick_color(rng, "signal_trims")
    plan = rectangle(plot.width_m, plot.depth_m)
    eaves_m = max(plot.height_m, 7.0)
    mesh, roof_m = body(plan, [Band(wall.material, wall.color, eaves_m, 1)], roof)
    pieces = [windowless(mesh), plinth(plan, plot.foundation_m), parapet(plan, wall.color, roof_m, 0.7)]
    pieces += _gates(plot, rng, dock_m=1.0)
    pieces.append(roof_units(rng, int(rng.integers(2, 6)), plot.width_m, plot.depth_m, roof_m))
    band = built(Material.METAL, trim)
    pieces.append(box(band, (plot.width_m + 0.1, 0.12, 0.9), (0.0, -0.02, roof_m - 0.4)))
    pieces.append(_office(plot, rng, wall))
    return Mesh.merged(pieces)


def tanks(plot: Plot, wall: Wall, rng: np.random.Generator) -> Mesh:
    """Upright tanks side by side with a pipe rack before them."""
    count = max(2, int(plot.width_m / 7.5))
    radius_m, height_m = 0.4 * plot.width_m / count, max(plot.height_m, 6.0)
    steel, frame = built(Material.METAL, wall.color), built(Material.METAL, pick_color(rng, "signal_trims"))
    x_m = (np.arange(count) + 0.5) / count * plot.width_m - plot.width_m / 2.0
    profile = [
        [radius_m, -plot.foundation_m],
        [radius_m, height_m],
        [radius_m * 0.6, height_m + 0.7],
        [0, height_m + 1],
    ]
    tank = lathe(steel, np.array(profile), segments=14)
    y_m = plot.depth_m - radius_m - 1.0
    pieces = [moved(tank, float(x), y_m) for x in x_m]
    rack_m = y_m - radius_m - 1.2
    legs = np.array([(x, rack_m, 1.5 - plot.foundation_m / 2.0) for x in np.append(x_m - radius_m, x_m[-1] + radius_m)])
    pieces.append(boxes(frame, np.tile((0.25, 0.25, 3.0 + plot.foundation_m), (len(legs), 1)), legs))
    for z_m in (2.5, 3.1):
        ends = (float(legs[0, 0]), rack_m, z_m), (float(legs[-1, 0]), rack_m, z_m)
        pieces.append(cylinder(steel, *ends, 0.16, segments=6))
    pieces.append(box(frame, (0.5, 0.3, height_m), (float(x_m[0]), y_m - radius_m - 0.1, height_m / 2.0)))
    return Mesh.merged(pieces)


def _gates(plot: Plot, rng: np.random.Generator, dock_m: float) -> list[Mesh]:
    """Gates along the front, at the floor or above a dock, and a door beside them."""
    color, frame = pick_color(rng, "garage_doors"), (96, 99, 102)
    room_m = plot.width_m - 12.0
    count = max(1, int(room_m / _GATE_SPACING_M))
    x_m = np.arange(count) * _GATE_SPACING_M - plot.width_m / 2.0 + 4.0
    leaf = Mesh.merged(gate(0.0, 3.4, 3.2 if dock_m else 4.2, color, frame))
    raised = leaf.transformed(np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, dock_m], [0, 0, 0, 1.0]]))
    pieces = [moved(raised, float(x), 0.0) for x in x_m]
    if dock_m:
        size = (count * _GATE_SPACING_M, 1.4, dock_m + plot.foundation_m)
        middle = (float(x_m.mean()), -0.6, (dock_m - plot.foundation_m) / 2.0)
        pieces.append(box(built(Material.CONCRETE, (140, 137, 130)), size, middle))
        bumpers = np.array([(x + side, -1.36, dock_m - 0.25) for x in x_m for side in (-1.2, 1.2)])
        pieces.append(
            boxes(built(Material.RUBBER, (30, 30, 31)), np.tile((0.25, 0.15, 0.4), (len(bumpers), 1)), bumpers)
        )
        canopy = (count * _GATE_SPACING_M, 1.2, 0.15)
        pieces.append(box(built(Material.METAL, frame), canopy, (float(x_m.mean()), -0.5, dock_m + 3.7)))
    return pieces


def _office(plot: Plot, rng: np.random.Generator, wall: Wall) -> Mesh:
    """Two storeys of rooms with windows before one end of the front."""
    width_m, depth_m = 2 * BAY_M, BAY_M
    plan = rectangle(width_m, depth_m)
    band = Band(Material.METAL_FACADE, shaded(wall.color, 1.1), _OFFICE_STOREY_M, 1 + (plot.height_m > 7.0))
    mesh, roof_m = body(plan, [band], (96, 94, 90))
    entrance = door(0.0, pick_color(rng, "doors"), (200, 200, 198), plot.foundation_m)
    annex = Mesh.merged([mesh, plinth(plan, plot.foundation_m), parapet(plan, wall.color, roof_m, 0.4), *entrance])
    return moved(annex, plot.width_m / 2.0 - width_m / 2.0 - 0.5, -0.6)
