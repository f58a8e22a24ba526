"""Campus buildings, schools and churches. Frame and conventions as in ``facades``."""

import numpy as np
import shapely

from simbev_ros.assets.architecture.facades import Band, body, built, ledge, moved, parapet, plinth, rectangle
from simbev_ros.assets.architecture.plot import Plot
from simbev_ros.assets.architecture.roofs import cross_gable, hipped_roof, roof_units, spire
from simbev_ros.assets.architecture.walls import Wall
from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.mesh.primitives import box, boxes
from simbev_ros.assets.palette import pick_color, shaded

_STOREY_M = 3.8
_TOWER_M = 5.0


def lecture_block(plot: Plot, wall: Wall, rng: np.random.Generator) -> Mesh:
    """A long building of a campus: large windows in brick or concrete, a glazed entrance, flat roof."""
    roof, trim = pick_color(rng, "flat_roofs"), pick_color(rng, "trims")
    plan = rectangle(plot.width_m, plot.depth_m)
    storeys = int(np.clip(round(plot.height_m / _STOREY_M), 2, 6))
    mesh, roof_m = body(plan, [Band(wall.material, wall.color, _STOREY_M, storeys)], roof)
    pieces = [mesh, plinth(plan, plot.foundation_m), parapet(plan, trim, roof_m, 0.6)]
    pieces += [ledge(plan, trim, _STOREY_M * k - 0.12, 0.24, 0.12) for k in range(1, storeys + 1)]
    pieces.append(roof_units(rng, int(rng.integers(3, 7)), plot.width_m, plot.depth_m, roof_m))
    return Mesh.merged([*pieces, *_entrance(plot, roof_m, rng)])


def school(plot: Plot, wall: Wall, rng: np.random.Generator) -> Mesh:
    """Two storeys of classrooms under a hipped roof."""
    roof = pick_color(rng, "pitched_roofs")
    plan = rectangle(plot.width_m, plot.depth_m)
    mesh, eaves_m = body(plan, [Band(wall.material, wall.color, 3.5, 2)], roof)
    pieces = [mesh, plinth(plan, plot.foundation_m), ledge(plan, pick_color(rng, "trims"), 3.4, 0.2, 0.1)]
    pieces.append(hipped_roof(plot.width_m, plot.depth_m, eaves_m, 0.45, roof))
    return Mesh.merged([*pieces, *_entrance(plot, eaves_m, rng)])


def church(plot: Plot, wall: Wall, rng: np.random.Generator) -> Mesh:
    """A nave with its gable to the street and a tower with a spire before it."""
    roof, stone = pick_color(rng, "pitched_roofs"), wall.color
    masonry = Wall(wall.style, Material.BRICK_FACADE if wall.style == "brick" else Material.FACADE, stone)
    nave = shapely.box(-plot.width_m / 2.0, _TOWER_M - 0.5, plot.width_m / 2.0, plot.depth_m)
    mesh, eaves_m = body(nave, [Band(masonry.material, stone, 7.0, 1)], roof)
    cover = cross_gable(plot.width_m, plot.depth_m - _TOWER_M + 0.5, eaves_m, 0.95, roof, masonry, 0.3)
    tower_m = eaves_m + rng.uniform(8.0, 12.0)
    shaft, _ = body(rectangle(_TOWER_M, _TOWER_M), [Band(masonry.material, shaded(stone, 1.04), tower_m / 3, 3)], roof)
    portal = built(Material.WOOD, (74, 52, 38))
    return Mesh.merged(
        [
            mesh,
            plinth(nave, plot.foundation_m),
            moved(cover, 0.0, _TOWER_M - 0.5),
            shaft,
            plinth(rectangle(_TOWER_M, _TOWER_M), plot.foundation_m),
            ledge(rectangle(_TOWER_M, _TOWER_M), shaded(stone, 1.1), tower_m - 0.4, 0.5, 0.2),
            spire(0.0, _TOWER_M / 2.0, _TOWER_M, tower_m, tower_m + rng.uniform(7.0, 12.0), roof),
            box(portal, (2.2, 0.16, 3.0), (0.0, -0.02, 1.5)),
            box(built(Material.PLASTER, (200, 196, 186)), (2.7, 0.1, 3.4), (0.0, -0.01, 1.7)),
            box(
                built(Material.CONCRETE, (150, 147, 140)),
                (3.4, 1.4, 0.12 + plot.foundation_m),
                (0.0, -0.6, 0.06 - plot.foundation_m / 2.0),
            ),
        ]
    )


def _entrance(plot: Plot, roof_m: float, rng: np.random.Generator) -> list[Mesh]:
    """A glazed stairwell in the middle of the front, with doors under a canopy."""
    frame = built(Material.METAL, (70, 74, 78))
    plan = shapely.box(-3.0, -0.5, 3.0, 2.5)
    stairs, top_m = body(
        plan, [Band(Material.OFFICE_GLASS, pick_color(rng, "walls.glass"), roof_m + 0.5, 1)], (96, 94, 90)
    )
    posts = np.array([[-2.6, -2.2, 1.5], [2.6, -2.2, 1.5]])
    deck_m = 0.1 + plot.foundation_m
    return [
        stairs,
        plinth(plan, plot.foundation_m),
        parapet(plan, (120, 122, 124), top_m, 0.3),
        box(frame, (6.4, 2.6, 0.22), (0.0, -1.4, 3.1)),
        boxes(frame, np.tile((0.16, 0.16, 3.0), (2, 1)), posts),
        box(built(Material.GLASS, (60, 76, 84)), (3.6, 0.08, 2.5), (0.0, -0.52, 1.3)),
        box(built(Material.CONCRETE, (150, 147, 140)), (6.4, 2.4, deck_m), (0.0, -1.5, 0.1 - deck_m / 2.0)),
    ]
