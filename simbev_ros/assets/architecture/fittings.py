"""What people fix to fronts and put before them: pipes, dishes, names, projecting signs, posters, goods, scaffolds.

Frame as in ``facades``. All of it stays in front of the front wall, within the space that a building's kind reserves.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from simbev_ros.assets.architecture.facades import BAY_M, building_finish
from simbev_ros.assets.architecture.plot import Plot
from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.mesh.primitives import Finish, box, boxes, cylinder
from simbev_ros.assets.palette import pick_color
from simbev_ros.assets.street.lettering import text_mesh
from simbev_ros.assets.street.rest_kinds import RestKind, rests_at_things
from simbev_ros.assets.street.sign_faces import VARIANTS, plate, sign_table
from simbev_ros.assets.street.small_things import small_thing
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Float64Array

_FRONT_BY_FACING = np.array([[0.0, 1.0, 0.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
"""(4, 4) turn of a sign that faces along x into one on the front wall, which faces against y."""

_WALLED = tuple(map(int, (Material.FACADE, Material.BRICK_FACADE, Material.TIMBER_FACADE, Material.CONCRETE_FACADE)))
_NAME_M, _NAME_AT, _NAME_OUT_M = 0.3, 0.905, 0.07  # letters: height; their height as a share of the shop's story
_HANGING_M, _BRACKET_OUT_M = 2.75, 0.15
_SCAFFOLD_SHARE, _LIFT_M = 0.05, 2.0
_MAX_PIPED_M = 20.0
_GOODS_Y_M, _WINDOW_SPACING_M, _CLEAR_OF_GOODS_M = -0.65, 2.4, 1.4
_WARES = ("crates", "racks", "table", "table_red", "pot", "")  # before shops; the last one is a stand with a menu


class Front(NamedTuple):
    """The front wall of a building: its width, its top, and the top of its shops, 0 if it has none."""

    width_m: float
    top_m: float
    shop_m: float


def find_front(building: Mesh, plot: Plot) -> Front:
    """Measure the front wall of a building's mesh."""
    on_front = (building.normals[:, 1] < -0.9) & (np.abs(building.vertices[:, 1]) < 0.02)
    material, z_m = building.material[on_front], building.vertices[on_front, 2]
    top_m, shop_m = (
        float(z_m[np.isin(material, own)].max(initial=0.0)) for own in (_WALLED, (int(Material.SHOPFRONT),))
    )
    return Front(plot.width_m, top_m, shop_m)


def fittings(front: Front, rng: np.random.Generator) -> tuple[list[Mesh], Float64Array]:
    """Draw the things at a front wall, and where people may sit at them or look into windows."""
    pieces: list[Mesh] = []
    rests = np.empty((0, 5))
    if front.shop_m:
        pieces += _shop_names(front, rng)
        goods, rests = _goods(front, rng)
        pieces += goods
    if front.top_m and rng.random() < _SCAFFOLD_SHARE:
        return pieces + _scaffold(front), rests[:0]
    if front.top_m:
        pieces += _pipes(front, rng) if front.top_m < _MAX_PIPED_M else []
        pieces += _small_things(front, rng)
    return pieces, rests


def _pipes(front: Front, rng: np.random.Generator) -> list[Mesh]:
    """Drain pipes at the ends of a front, and a gutter."""
    finish = building_finish(Material.PLASTIC, (46, 48, 50) if rng.random() < 0.6 else (196, 194, 188))
    x_m = (front.width_m / 2.0 - 0.12) * np.array([-1.0, 1.0])
    low_m = max(front.shop_m, 0.0)
    centers = np.column_stack([x_m, [-0.07, -0.07], np.full(2, (front.top_m + low_m) / 2.0)])
    return [boxes(finish, np.tile([0.1, 0.1, front.top_m - low_m], (2, 1)), centers)]


def _small_things(front: Front, rng: np.random.Generator) -> list[Mesh]:
    """Dishes, alarm boxes, air conditioners and flower boxes between the windows of upper floors, sometimes a flag."""
    bays = max(1, round(front.width_m / BAY_M))
    edges_m = np.arange(1, bays) * front.width_m / bays - front.width_m / 2.0
    floors_m = np.arange(max(front.shop_m, 3.0), front.top_m - 1.5, 3.0)
    pieces = []
    for z_m in floors_m.tolist():
        for x_m in edges_m.tolist():
            draw = rng.random()
            if draw < 0.1:
                pieces.append(_dish().shift(x_m, -0.25, z_m + 1.6))
            elif draw < 0.15:
                color = pick_color(rng, "signal_trims")
                pieces.append(box(building_finish(Material.PLASTIC, color), (0.3, 0.12, 0.36), (x_m, -0.08, z_m + 1.9)))
            elif draw < 0.2:
                pieces.append(
                    box(building_finish(Material.METAL, (196, 197, 194)), (0.8, 0.35, 0.6), (x_m, -0.2, z_m + 0.45))
                )
            elif draw < 0.28:
                x_window_m = x_m - front.width_m / bays / 2.0
                green = Finish(Material.FOLIAGE, Tag.VEGETATION, pick_color(rng, "flowers"))
                pot = building_finish(Material.BRICK, (150, 92, 66))
                pieces += [
                    box(pot, (1.2, 0.22, 0.18), (x_window_m, -0.14, z_m + 0.72)),
                    box(green, (1.15, 0.24, 0.22), (x_window_m, -0.15, z_m + 0.9)),
                ]
    if len(floors_m) and rng.random() < 0.08:
        at_m = float(floors_m[0]) + 1.0
        pole, cloth = building_finish(Material.METAL, (210, 210, 206)), pick_color(rng, "awnings")
        pieces += [
            cylinder(pole, (0.0, 0.0, at_m), (0.0, -0.85, at_m + 1.1), 0.025, segments=5),
            box(building_finish(Material.CLOTH, cloth), (0.03, 0.55, 0.8), (0.0, -0.58, at_m + 0.2)),
        ]
    return pieces


@lru_cache(maxsize=1)
def _dish() -> Mesh:
    """A satellite dish on an arm."""
    gray = building_finish(Material.METAL, (186, 188, 188))
    bowl = cylinder(gray, (0.0, 0.0, 0.0), (0.06, -0.17, 0.04), 0.08, end_radius_m=0.33, segments=8)
    return Mesh.merge([bowl, box(gray, (0.05, 0.3, 0.05), (0.0, 0.1, 0.0))])


def _shop_names(front: Front, rng: np.random.Generator) -> list[Mesh]:
    """Names over the shops, projecting signs between them, posters in their windows."""
    words, faces = sign_table()["words"], sign_table()["hanging"]
    count = max(1, round(front.width_m / (2 * BAY_M)))
    unit_m = front.width_m / count
    ink = building_finish(Material.PLAIN, (238, 230, 206))
    pieces = []
    for k in range(count):
        x_m = (k + 0.5) * unit_m - front.width_m / 2.0
        name = words["shop"][int(rng.integers(len(words["shop"])))]
        word = f"{words['brand'][int(rng.integers(len(words['brand'])))]} {name}" if rng.random() < 0.4 else name
        letters = text_mesh(ink, word, _NAME_M, max_width_m=unit_m - 1.0)
        pieces.append(_on_front(letters, x_m, _NAME_OUT_M, _NAME_AT * front.shop_m))
        if rng.random() < 0.75:
            sign = plate(faces[int(rng.integers(len(faces)))], int(rng.integers(VARIANTS))).mesh
            low_m, high_m = sign.bounds_m
            out_m = float(high_m[1]) + _BRACKET_OUT_M
            at_m = _HANGING_M + float(high_m[2] - low_m[2]) / 2.0
            pieces.append(sign.shift(x_m - unit_m / 2.0 + 0.25, -out_m, at_m))
            bar = (x_m - unit_m / 2.0 + 0.25, -out_m / 2.0, at_m + float(high_m[2]) + 0.03)
            pieces.append(box(building_finish(Material.METAL, (40, 42, 44)), (0.04, out_m + 0.2, 0.04), bar))
        if rng.random() < 0.4:
            poster = plate("poster", int(rng.integers(VARIANTS))).mesh
            pieces.append(_on_front(poster, x_m + unit_m * rng.uniform(-0.3, 0.3), 0.04, 1.25))
    return pieces


def _goods(front: Front, rng: np.random.Generator) -> tuple[list[Mesh], Float64Array]:
    """Before shops: stands with a menu, crates, racks, tables, pots with plants; and seats and spots at windows."""
    pieces, taken_m, rests, x_m = [], [], [], 1.1 - front.width_m / 2.0
    while x_m < front.width_m / 2.0 - 1.1:
        if rng.random() < 0.45:
            name = _WARES[int(rng.integers(len(_WARES)))]
            thing = small_thing(name) if name else plate("stand", int(rng.integers(VARIANTS))).mesh
            pieces.append(thing.transform(_FRONT_BY_FACING).shift(x_m, _GOODS_Y_M, 0.0 if name else 0.5))
            taken_m.append(x_m)
            if name.startswith("table"):
                rests += (rests_at_things()["table"] + [x_m, _GOODS_Y_M, 0.0, 0.0, 0.0]).tolist()
        x_m += rng.uniform(1.7, 3.0)
    for at_m in np.arange(1.2 - front.width_m / 2.0, front.width_m / 2.0 - 1.0, _WINDOW_SPACING_M).tolist():
        if all(abs(at_m - other_m) > _CLEAR_OF_GOODS_M for other_m in taken_m):
            rests.append([at_m, _GOODS_Y_M, 0.0, 90.0, RestKind.WINDOW])
    return pieces, np.array(rests).reshape(-1, 5)


def _scaffold(front: Front) -> list[Mesh]:
    """Tubes and planks before the whole front."""
    steel, plank = (
        Finish(Material.METAL, Tag.OTHER, (150, 152, 152)),
        Finish(Material.WOOD, Tag.OTHER, (158, 128, 88)),
    )
    x_m = np.linspace(-front.width_m / 2.0 + 0.1, front.width_m / 2.0 - 0.1, max(2, round(front.width_m / 2.2)) + 1)
    lifts_m = np.arange(_LIFT_M + 0.3, front.top_m + 1.0, _LIFT_M)
    top_m = float(lifts_m[-1]) + 1.1
    tubes = np.array([(x, y, top_m / 2.0) for x in x_m for y in (-0.85, -0.1)])
    rails = np.array([(0.0, -0.85, z + up) for z in lifts_m for up in (0.0, 0.5, 1.0)])
    boards = np.array([(0.0, -0.48, z) for z in lifts_m])
    return [
        boxes(steel, np.tile([0.05, 0.05, top_m], (len(tubes), 1)), tubes),
        boxes(steel, np.tile([front.width_m, 0.05, 0.05], (len(rails), 1)), rails),
        boxes(plank, np.tile([front.width_m, 0.7, 0.05], (len(boards), 1)), boards),
    ]


def _on_front(sign: Mesh, x_m: float, out_m: float, z_m: float) -> Mesh:
    """A sign flat on the front wall."""
    return sign.transform(_FRONT_BY_FACING).shift(x_m, -out_m, z_m)
