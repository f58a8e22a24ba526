"""Panels of fences, walls and hedges. Frame: along x from 0, z up; all vertices of a panel follow the ground."""

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache, partial
from typing import Any

import numpy as np

from simbev_ros.assets.flora.bushes import hedge
from simbev_ros.assets.flora.ivy import ivy
from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.graded import GradedMesh
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.mesh.primitives import Finish, box, boxes, lathe
from simbev_ros.assets.palette import pick_color
from simbev_ros.assets.placement.tiles import upright_pose
from simbev_ros.config.weather import Season
from simbev_ros.foundation.random import stream
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.tables import load_table
from simbev_ros.foundation.types import Float64Array

_BEECH: Mapping[Season, str] = {"spring": "fresh_leaves", "autumn": "copper_leaves", "winter": "dead_leaves"}

_IVY = 100

VARIANTS = 3
"""Number of variants of a panel, which differ in color."""

_RAILED: Mapping[str, Mapping[str, Any]] = load_table("simbev_ros.assets.street", "barriers.yaml")["railed"]

PANEL_M = {
    "picket": 2.2,
    "boards": 2.4,
    "wall": 2.4,
    "hedge": 2.4,
    "high_hedge": 2.4,
    "bars": 3.0,
    "field": 4.0,
    "high_wall": 2.4,
    "posts": 3.2,
    **{kind: float(entry["length_m"]) for kind, entry in _RAILED.items()},
}
"""Length of one panel, by kind of barrier."""


@lru_cache(maxsize=64)
def panel(kind: str, variant: int, season: Season = "summer") -> Mesh | GradedMesh:
    """Panel of a kind of barrier in one of its variants; one variant of hedges is of beech, which turns brown.

    Ivy grows on one variant of walls.
    """
    rng = stream(variant, f"barriers.{kind}")
    length_m = PANEL_M[kind]
    if kind in ("hedge", "high_hedge"):
        leafage = _BEECH.get(season, "hedges") if variant == 0 else "hedges"
        return hedge(rng, length_m, leafage, 1.3 if kind == "hedge" else 1.9)
    if kind == "wall" and variant == 1:
        bare = _wall(rng)
        return Mesh.merge([bare, ivy(rng, bare, _IVY)])
    return _BUILDERS[kind](rng)


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


def _railed(entry: Mapping[str, Any], rng: np.random.Generator) -> Mesh:
    """Bars between two rails, with posts, alone or on a wall; by a row of barriers.yaml."""
    length_m, wall_m = float(entry["length_m"]), float(entry["wall_m"])
    base = _masonry(rng, length_m, wall_m) if wall_m else Mesh.empty()
    if "bars_m" not in entry:
        return base
    steel = Finish(Material.METAL, Tag.FENCE, pick_color(rng, entry["color"]))
    bars = _barred(steel, length_m, entry["bars_m"], entry["rails_m"], entry["spacing_m"], entry["radius_m"])
    return Mesh.merge([base, bars])


def _high_wall(rng: np.random.Generator) -> Mesh:
    """A wall between a yard and the street, 2.3 m high, with pillars."""
    length_m = PANEL_M["high_wall"]
    pillar = Finish(Material.BRICK, Tag.WALL, pick_color(rng, "walls.brick"))
    return Mesh.merge([_masonry(rng, length_m, 2.2), box(pillar, (0.36, 0.34, 2.9), (0.18, 0.0, 0.95))])


def _posts(rng: np.random.Generator) -> Mesh:
    """Two bollards beside a lawn or a forecourt, 0.95 m high."""
    iron = Finish(Material.METAL, Tag.POLE, pick_color(rng, "railings"))
    profile = np.array([[0.075, -0.3], [0.075, 0.8], [0.095, 0.83], [0.06, 0.93], [0.0, 0.96]])
    post = lathe(iron, profile, segments=8)
    return Mesh.merge(post.copies(np.stack([upright_pose((x_m, 0.0), 0.0) for x_m in (0.8, 2.4)])))


def _masonry(rng: np.random.Generator, length_m: float, height_m: float) -> Mesh:
    """Brick or plaster with a coping, down to 0.5 m below the ground."""
    brick = rng.random() < 0.7
    color = pick_color(rng, "walls.brick" if brick else "walls_low")
    finish = Finish(Material.BRICK if brick else Material.PLASTER, Tag.WALL, color)
    stone = Finish(Material.CONCRETE, Tag.WALL, (156, 152, 144))
    body_m = height_m + 0.5
    return Mesh.merge(
        [
            box(finish, (length_m, 0.24, body_m), (length_m / 2.0, 0.0, height_m - body_m / 2.0)),
            box(stone, (length_m, 0.32, 0.07), (length_m / 2.0, 0.0, height_m + 0.03)),
        ]
    )


def _barred(
    finish: Finish,
    length_m: float,
    bars_m: Sequence[float],
    rails_m: Sequence[float],
    spacing_m: float,
    radius_m: float,
) -> Mesh:
    """Bars between their low and high end, rails, a post. There is no coarse mesh: labels of gaps would differ."""
    x_m = np.arange(spacing_m / 2.0, length_m, spacing_m)
    rails = np.array([(length_m / 2.0, 0.0, z) for z in rails_m])
    top_m = max(rails_m[-1], bars_m[1]) + 0.04
    return Mesh.merge(
        [
            _bars_along(finish, x_m, bars_m, radius_m),
            boxes(finish, np.tile((length_m, 0.035, 0.035), (len(rails), 1)), rails),
            box(finish, (0.05, 0.05, top_m + 0.4), (0.025, 0.0, (top_m - 0.4) / 2.0)),
        ]
    )


def _bars_along(finish: Finish, x_m: Float64Array, z_m: Sequence[float], radius_m: float) -> Mesh:
    """Upright three-sided bars at (N,) positions along x."""
    turn = np.pi / 6.0 + np.arange(3) * (2.0 * np.pi / 3.0)
    ring = np.column_stack([np.cos(turn), np.sin(turn), np.zeros(3)])
    low, high = np.array([0.0, 0.0, z_m[0]]), np.array([0.0, 0.0, z_m[1]])
    corners = np.concatenate([ring * radius_m + low, ring * radius_m + high])
    count = len(x_m)
    vertices = np.tile(corners, (count, 1, 1))
    vertices[..., 0] += x_m[:, None]
    faces = np.arange(0, 6 * count, 6)[:, None, None] + _BAR_TRIANGLES
    return Mesh.indexed(
        vertices.reshape(-1, 3),
        faces.reshape(-1, 3).astype(np.int32),
        normals=np.tile(ring, (2 * count, 1)),
        material=finish.material,
        tag=finish.tag,
        color=finish.color,
    )


_BAR_TRIANGLES = np.array([[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4], [2, 0, 3], [2, 3, 5], [0, 2, 1], [3, 4, 5]])
_BUILDERS: Mapping[str, Callable[[np.random.Generator], Mesh | GradedMesh]] = {
    "picket": _picket,
    "boards": _boards,
    "wall": _wall,
    "bars": _bars,
    "field": _field,
    "high_wall": _high_wall,
    "posts": _posts,
    **{kind: partial(_railed, entry) for kind, entry in _RAILED.items()},
}
