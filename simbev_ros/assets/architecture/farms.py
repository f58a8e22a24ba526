"""Farm buildings: barns, sheds, silos. Frame and conventions as in ``facades``."""

import numpy as np

from simbev_ros.assets.architecture.facades import Band, body, built, gate, moved, plinth, rectangle, windowless
from simbev_ros.assets.architecture.plot import Plot
from simbev_ros.assets.architecture.roofs import gabled_roof, gambrel_roof
from simbev_ros.assets.architecture.walls import Wall
from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.mesh.primitives import box, boxes, lathe
from simbev_ros.assets.palette import pick_color


def barn(plot: Plot, wall: Wall, rng: np.random.Generator) -> Mesh:
    """A barn of boards with a big door to the yard, and one at the end."""
    roof = pick_color(rng, "barn_roofs")
    plan = rectangle(plot.width_m, plot.depth_m)
    eaves_m = float(np.clip(plot.height_m, 3.6, 5.0))
    planks = Wall("timber", Material.TIMBER_FACADE, pick_color(rng, "walls.barn"))
    mesh, _ = body(plan, [Band(planks.material, planks.color, eaves_m, 1)], roof)
    gambrel = rng.random() < 0.55
    cover = gambrel_roof(plot.width_m, plot.depth_m, eaves_m, roof, planks)
    pieces = [windowless(mesh), plinth(plan, plot.foundation_m)]
    pieces.append(cover if gambrel else gabled_roof(plot.width_m, plot.depth_m, eaves_m, 0.6, roof, planks, 0.4))
    leaf = _barn_door(3.6, min(3.3, eaves_m - 0.2))
    pieces += [moved(leaf, 0.0, 0.0), moved(leaf, plot.width_m / 2.0, plot.depth_m / 2.0, 1)]
    panes = np.array([(x, 0.0, 1.9) for x in (-0.35 * plot.width_m, 0.35 * plot.width_m)])
    pieces.append(boxes(built(Material.WOOD, (226, 222, 212)), np.tile((1.2, 0.08, 1.0), (2, 1)), panes))
    pieces.append(boxes(built(Material.GLASS, (40, 48, 52)), np.tile((1.0, 0.12, 0.8), (2, 1)), panes))
    return Mesh.merged(pieces)


def shed(plot: Plot, wall: Wall, rng: np.random.Generator) -> Mesh:
    """A long low shed of sheet metal with gates."""
    roof = pick_color(rng, "barn_roofs")
    plan = rectangle(plot.width_m, plot.depth_m)
    sheets = Wall("metal", Material.METAL_FACADE, pick_color(rng, "walls.metal"))
    mesh, eaves_m = body(plan, [Band(sheets.material, sheets.color, 3.8, 1)], roof)
    pieces = [windowless(mesh), plinth(plan, plot.foundation_m)]
    pieces.append(gabled_roof(plot.width_m, plot.depth_m, eaves_m, 0.3, roof, sheets, 0.3))
    leaf = Mesh.merged(gate(0.0, 3.6, 3.2, pick_color(rng, "garage_doors"), (104, 106, 108)))
    pieces += [moved(leaf, float(x), 0.0) for x in np.arange(3.5 - plot.width_m / 2.0, plot.width_m / 2.0 - 2.5, 6.0)]
    return Mesh.merged(pieces)


def silo(plot: Plot, wall: Wall, rng: np.random.Generator) -> Mesh:
    """A pair of round silos with domed or conical tops."""
    count = 2 if plot.width_m > 8.0 else 1
    radius_m = min(0.45 * plot.width_m / count, 3.0)
    top_m = float(rng.uniform(8.0, 13.0))
    steel = built(Material.METAL, pick_color(rng, "silos"))
    profile = [[radius_m, -plot.foundation_m], [radius_m, top_m], [radius_m * 0.7, top_m + 0.9], [0.0, top_m + 1.5]]
    tower = lathe(steel, np.array(profile), segments=16)
    hoops = [
        lathe(steel, np.array([[radius_m + 0.05, z], [radius_m + 0.05, z + 0.12]]), segments=16, caps=True)
        for z in np.arange(1.5, top_m, 2.5)
    ]
    ladder = box(built(Material.METAL, (90, 92, 94)), (0.5, 0.12, top_m), (0.0, -radius_m - 0.06, top_m / 2.0))
    one = Mesh.merged([tower, *hoops, ladder])
    x_m = (np.arange(count) - (count - 1) / 2.0) * (2.0 * radius_m + 0.6)
    return Mesh.merged([moved(one, float(x), plot.depth_m / 2.0) for x in x_m])


def _barn_door(width_m: float, height_m: float) -> Mesh:
    """Two leaves of boards in a white frame with crosses."""
    white, board = built(Material.WOOD, (222, 217, 206)), built(Material.WOOD, (112, 58, 46))
    uprights = np.array([(x, -0.06, height_m / 2.0) for x in (-width_m / 2.0, 0.0, width_m / 2.0)])
    levels = np.array([(0.0, -0.06, z) for z in (0.1, height_m / 2.0, height_m - 0.05)])
    return Mesh.merged(
        [
            box(board, (width_m, 0.1, height_m), (0.0, -0.03, height_m / 2.0)),
            boxes(white, np.tile((0.16, 0.1, height_m), (3, 1)), uprights),
            boxes(white, np.tile((width_m, 0.1, 0.16), (3, 1)), levels),
        ]
    )
