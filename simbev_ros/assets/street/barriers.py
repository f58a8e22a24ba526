"""Panels of fences, walls and hedges. Frame: along x from 0, z up; all vertices of a panel follow the ground."""

from functools import lru_cache

import numpy as np

from simbev_ros.assets.flora.bushes import hedge
from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.graded import GradedMesh
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.mesh.primitives import Finish, box, boxes
from simbev_ros.assets.palette import pick_color
from simbev_ros.foundation.random import stream
from simbev_ros.foundation.semantics import Tag

VARIANTS = 3
"""Number of variants of a panel, which differ in color."""

PANEL_M = {"picket": 2.2, "boards": 2.4, "wall": 2.4, "hedge": 2.4, "high_hedge": 2.4, "bars": 3.0, "field": 4.0}
"""Length of one panel, by kind of barrier."""


@lru_cache(maxsize=64)
def panel(kind: str, variant: int) -> Mesh | GradedMesh:
    """Panel of a kind of barrier in one of its variants."""
    rng = stream(variant, f"barriers.{kind}")
    length_m = PANEL_M[kind]
    if kind == "hedge":
        return hedge(rng, length_m)
    if kind == "high_hedge":
        return hedge(rng, length_m, height_m=1.9)
    return {"picket": _picket, "boards": _boards, "wall": _wall, "bars": _bars, "field": _field}[kind](rng)


def _picket(rng: np.random.Generator) -> Mesh:
    """A low wooden fence, 1.1 m high."""
    length_m = PANEL_M["picket"]
    wood = Finish(Material.WOOD, Tag.FENCE, pick_color(rng, "fences"))
    x_m = np.arange(0.17, length_m, 0.34)
    pickets = np.column_stack([x_m, np.zeros(len(x_m)), np.full(len(x_m), 0.58)])
    rails = np.array([[length_m / 2.0, 0.03, 0.3], [length_m / 2.0, 0.03, 0.85]])
    return Mesh.merge(
        [
            boxes(wood, np.tile((length_m, 0.03, 0.08), (2, 1)), rails),
            boxes(wood, np.tile((0.09, 0.025, 1.0), (len(x_m), 1)), pickets),
            box(wood, (0.1, 0.1, 1.5), (0.05, 0.0, 0.35)),
        ]
    )


def _boards(rng: np.random.Generator) -> Mesh:
    """A closed board fence between gardens, 1.7 m high."""
    length_m = PANEL_M["boards"]
    wood = Finish(Material.WOOD, Tag.FENCE, pick_color(rng, "fences"))
    return Mesh.merge(
        [
            box(wood, (length_m - 0.1, 0.03, 1.75), (length_m / 2.0, 0.0, 0.75)),
            box(wood, (0.12, 0.12, 2.1), (0.06, 0.0, 0.75)),
            box(wood, (length_m, 0.1, 0.05), (length_m / 2.0, 0.0, 1.65)),
        ]
    )


def _wall(rng: np.random.Generator) -> Mesh:
    """A garden wall with a coping, 1.5 m high."""
    length_m = PANEL_M["wall"]
    brick = Finish(Material.BRICK, Tag.WALL, pick_color(rng, "walls_low"))
    stone = Finish(Material.CONCRETE, Tag.WALL, (156, 152, 144))
    return Mesh.merge(
        [
            box(brick, (length_m, 0.22, 2.0), (length_m / 2.0, 0.0, 0.45)),
            box(stone, (length_m, 0.3, 0.08), (length_m / 2.0, 0.0, 1.49)),
        ]
    )


def _bars(rng: np.random.Generator) -> Mesh:
    """A bar fence around industrial sites, 2 m high."""
    length_m = PANEL_M["bars"]
    steel = Finish(Material.METAL, Tag.FENCE, (134, 140, 142))
    rails = np.array([(length_m / 2.0, 0.0, z) for z in (0.2, 1.85)])
    bars = np.array([(x, 0.0, 1.05) for x in np.arange(0.3, length_m, 0.25)])
    return Mesh.merge(
        [
            boxes(steel, np.tile((length_m, 0.03, 0.04), (2, 1)), rails),
            boxes(steel, np.tile((0.02, 0.02, 1.85), (len(bars), 1)), bars),
            box(steel, (0.07, 0.07, 2.5), (0.035, 0.0, 0.85)),
        ]
    )


def _field(rng: np.random.Generator) -> Mesh:
    """Posts and rails along fields, 1.1 m high."""
    length_m = PANEL_M["field"]
    wood = Finish(Material.WOOD, Tag.FENCE, pick_color(rng, "fences"))
    rails = np.array([(length_m / 2.0, 0.05, z) for z in (0.45, 0.95)])
    return Mesh.merge(
        [
            box(wood, (0.12, 0.12, 1.5), (0.06, 0.0, 0.35)),
            boxes(wood, np.tile((length_m, 0.04, 0.09), (2, 1)), rails),
        ]
    )
