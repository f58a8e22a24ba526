"""Generates meshes of trees. Frame: origin at the foot, z up; copies may be turned and scaled."""

import numpy as np

from simbev_ros.assets.flora.crowns import ROOT_M, ball, blades, branches, crown, foliage, leaves, trunk
from simbev_ros.assets.flora.deciduous import Deciduous, Limbs, dress, is_full, leaf_color
from simbev_ros.assets.flora.skeleton import Crown, limbs_of_stem
from simbev_ros.assets.mesh.graded import GradedMesh
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.mesh.primitives import lathe
from simbev_ros.assets.palette import Color, pick_color, shade_color
from simbev_ros.config.weather import Season
from simbev_ros.foundation.types import Float64Array

_LIGHT = Deciduous(limbs=6, branches=4, twig_width=3.0)
_FRONDS, _LEAFLETS = 18, 7
_CONE = 0.8
"""Base radius of a spruce's coarse cone, over the reach of its branches."""


class BroadLeaved(Deciduous):
    """Proportions and leaves of a broad-leaved tree; species.yaml explains the fields."""

    height_m: float
    trunk_m: float
    radius_m: float
    sprigs: int
    stoutness: float = 0.018
    bark: str = "barks"
    evergreen: bool = False


def broad_leaved(rng: np.random.Generator, tree: BroadLeaved, season: Season) -> GradedMesh:
    """Generate a broad-leaved tree: a closed crown in summer, also branches with few leaves or none in other seasons.

    The trunk is the same in all seasons.
    """
    leaf, height_m = pick_color(rng, tree.leaves, 0.1), tree.height_m * rng.uniform(0.9, 1.15)
    middle = np.array([*rng.normal(0.0, 0.15, 2), (height_m + tree.trunk_m) / 2.0])
    radii = np.array([tree.radius_m, tree.radius_m, (height_m - tree.trunk_m) / 2.0])
    fork = np.array([*rng.normal(0, 0.06, 2), tree.trunk_m * 0.6])
    top = middle + radii * np.array([0.0, 0.0, 2.0 * tree.leader - 1.0])
    thickness_m = tree.stoutness * height_m
    stem = trunk(
        rng, np.array([[0, 0, ROOT_M], fork, top]), thickness_m, thickness_m * (0.5 - 0.4 * tree.leader), bark=tree.bark
    )
    red, green, blue = stem.mesh.color[0].tolist()
    if tree.evergreen or is_full(rng, season):
        turn = rng.uniform(0.0, 2.0 * np.pi) + np.arange(3) * 2.1
        tips = middle + np.column_stack([np.cos(turn), np.sin(turn), rng.uniform(-0.5, 0.1, 3)]) * radii * 0.7
        limbs = branches(rng, fork * [1, 1, 1.5], tips, 0.4 * thickness_m, (red, green, blue))
        if season != "summer" and not tree.evergreen:
            leaf = leaf_color(rng, tree, season)
        return GradedMesh.merge([stem, limbs, crown(rng, middle, radii, tree.sprigs, leaf, rise=-0.15 - tree.hang)])
    held = Crown(middle, radii)
    lowest = fork + (top - fork) * max(tree.fork, 0.3 * tree.trunk_m / float(top[2] - fork[2]))
    shoots = limbs_of_stem(rng, tree, held, lowest, thickness_m)
    return GradedMesh.merge([stem, dress(rng, tree, Limbs(shoots, held, (red, green, blue)), tree.sprigs, season)])


def spruce(rng: np.random.Generator) -> GradedMesh:
    """Generate a spruce, about 11 m high: tiers of drooping branches around a straight trunk."""
    return _spruce(rng, height_m=rng.uniform(9.5, 12.5), reach_m=2.6, tiers=12, sprigs=300, cover=10.5)


def pine(rng: np.random.Generator) -> GradedMesh:
    """Generate a pine with a bare trunk and a high crown, about 12 m high."""
    return _high_crowned(rng, 0.1, (10.5, 13.5), 0.77, (0.22, 0.1), (2.1, 2.1, 2.7), 260)


def stone_pine(rng: np.random.Generator) -> GradedMesh:
    """Generate an umbrella pine, about 9 m high."""
    return _high_crowned(rng, 0.12, (8.0, 10.5), 0.86, (0.24, 0.13), (3.2, 3.2, 1.2), 300)


def cypress(rng: np.random.Generator) -> GradedMesh:
    """Generate a cypress, a slender dark column, about 9 m high."""
    color, height_m = pick_color(rng, "needles", 0.1), rng.uniform(7.5, 11.0)
    stem = trunk(rng, np.array([[0.0, 0.0, ROOT_M], [0.0, 0.0, 1.2]]), 0.14, 0.12, segments=3)
    middle, radii = np.array([0.0, 0.0, 0.5 + height_m / 2.0]), np.array([0.8, 0.8, height_m / 2.0])
    return GradedMesh.merge([stem, ball(rng, middle, radii, middle * [1.0, 1.0, 0.0], 200, color, rise=1.5, cover=0.9)])


def palm(rng: np.random.Generator) -> GradedMesh:
    """Generate a palm with drooping fronds, about 8 m high."""
    height_m, lean = rng.uniform(6.0, 9.5), rng.normal(0.0, 0.35, 2)
    spine = np.array([[0.0, 0.0, ROOT_M], [*lean * 0.3, height_m * 0.5], [*lean, height_m]])
    color, top = pick_color(rng, "palm_leaves", 0.1), np.array([*lean, height_m])
    turns = np.arange(_FRONDS) * 2.4 + rng.normal(0.0, 0.1, _FRONDS)
    fronds = [
        _frond(rng, color, turn, rise, top) for turn, rise in zip(turns, np.linspace(-0.5, 1.1, _FRONDS), strict=True)
    ]
    leafage = Mesh.merge(fronds)
    return GradedMesh.merge([trunk(rng, spine, 0.2, 0.15, segments=7), GradedMesh(leafage, leafage)])


def acacia(rng: np.random.Generator) -> GradedMesh:
    """Generate a flat-topped tree of dry climates on forked stems, about 5 m high."""
    color, height_m = pick_color(rng, "dry_leaves", 0.1), rng.uniform(4.5, 6.0)
    pieces = []
    for turn in rng.uniform(0.0, 2.0 * np.pi) + np.arange(3) * 2.1:
        out = np.array([np.cos(turn), np.sin(turn)])
        tip = np.array([*out * 1.1, height_m * 0.78])
        pieces.append(trunk(rng, np.array([[0.0, 0.0, ROOT_M], [*out * 0.3, height_m * 0.4], tip]), 0.15, 0.06, 4))
        top = np.array([*out * 1.2, height_m * rng.uniform(0.8, 0.95)])
        size_m = np.array([1.7, 1.7, 0.55]) * rng.uniform(0.85, 1.15)
        pieces.append(
            ball(rng, top, size_m, np.array([0.0, 0.0, height_m * 0.6]), 70, color, cover=0.7, coarse_detail=0)
        )
    return GradedMesh.merge(pieces)


def light_broad_leaved(rng: np.random.Generator, season: Season) -> GradedMesh:
    """Generate a low-polygon broad-leaved tree for distant or hidden positions, about 10 m high."""
    color, radii_m, height_m = pick_color(rng, "broad_leaves", 0.1), np.array([3.0, 3.0, 3.9]), rng.uniform(9.0, 11.0)
    if season == "summer":
        return _light_tree(rng, color, radii_m, height_m)
    held = Crown(np.array([*rng.normal(0.0, 0.2, 2), height_m - radii_m[2]]), radii_m)
    stem = trunk(rng, np.array([[0.0, 0.0, ROOT_M], held.middle_m]), 0.2, 0.12, segments=3)
    shoots = limbs_of_stem(rng, _LIGHT, held, 0.5 * held.middle_m, 0.15)
    return GradedMesh.merge([stem, dress(rng, _LIGHT, Limbs(shoots, held, (94, 76, 60)), 60, season)])


def light_spruce(rng: np.random.Generator) -> GradedMesh:
    """Generate a low-polygon spruce, about 11 m high."""
    return _spruce(rng, height_m=rng.uniform(9.5, 13.5), reach_m=2.4, tiers=8, sprigs=50, cover=7.0)


def light_olive(rng: np.random.Generator) -> GradedMesh:
    """Generate a low-polygon olive or holm oak, about 5 m high."""
    return _light_tree(rng, pick_color(rng, "olive_leaves", 0.12), np.array([2.0, 2.0, 1.7]), rng.uniform(4.4, 6.0))


def light_acacia(rng: np.random.Generator) -> GradedMesh:
    """Generate a low-polygon tree of dry climates, about 4.5 m high."""
    return _light_tree(rng, pick_color(rng, "dry_leaves", 0.12), np.array([2.1, 2.1, 0.9]), rng.uniform(3.8, 5.2))


def _light_tree(rng: np.random.Generator, color: Color, radii_m: Float64Array, height_m: float) -> GradedMesh:
    """A three-sided stem and a crown of few lobes."""
    middle = np.array([*rng.normal(0.0, 0.2, 2), height_m - radii_m[2]])
    stem = trunk(rng, np.array([[0.0, 0.0, ROOT_M], middle]), 0.2, 0.12, segments=3)
    return GradedMesh.merge([stem, crown(rng, middle, radii_m, 34, color, lobes=2, cover=0.13, coarse_detail=0)])


def _spruce(
    rng: np.random.Generator, height_m: float, reach_m: float, tiers: int, sprigs: int, cover: float
) -> GradedMesh:
    """A cone of needles and tiers of sprigs, with a total area of about half of ``cover`` · reach · height."""
    color, low_m = pick_color(rng, "needles", 0.1), rng.uniform(0.9, 1.3)
    stem = trunk(rng, np.array([[0.0, 0.0, ROOT_M], [0.0, 0.0, low_m + 0.5]]), 0.2, 0.18, segments=3)
    profile = np.array([[0.0, low_m + 0.5], [0.6 * reach_m, low_m + 0.3], [0.0, 0.97 * height_m]])
    core = lathe(leaves(shade_color(color, 0.6)), profile, segments=5, crease_deg=80.0)
    turn_rad = np.arange(sprigs) * np.pi * (3.0 - 5.0**0.5) + rng.uniform(0.0, 0.5, sprigs)
    around = np.stack([np.cos(turn_rad), np.sin(turn_rad)], axis=1)
    rise = 1.0 - np.sqrt((np.arange(sprigs) + 0.5) / sprigs)  # uniform over the cone, then grouped into tiers
    rise = (np.floor(rise * tiers) + rng.uniform(0.15, 0.75, sprigs)) / tiers
    out_m = (reach_m * (1.0 - rise) * rng.uniform(0.6, 0.85, sprigs))[:, None]
    positions_m = np.column_stack([around * out_m, low_m + (height_m - low_m) * rise])
    outward, hanging = (np.column_stack([around, np.full(sprigs, rise)]) / np.hypot(1.0, rise) for rise in (0.6, -0.6))
    length_m = np.sqrt(cover * reach_m * height_m / sprigs) * (1.2 - rise)
    middle_m = np.array([0.0, 0.0, low_m])
    leafage = Mesh.merge([core, foliage(rng, positions_m, outward, hanging, middle_m, length_m, color)])
    outline_m = np.array([[0.0, low_m - 0.1], [_CONE * reach_m, low_m - 0.1], [0.0, 1.01 * height_m]])
    red, green, blue = leafage.color.mean(axis=0).round().astype(int).tolist()
    cone = lathe(leaves((red, green, blue)), outline_m, segments=6, crease_deg=80.0)
    return GradedMesh.merge([stem, GradedMesh(leafage, cone)])


def _frond(rng: np.random.Generator, color: Color, turn_rad: float, rise: float, root_m: Float64Array) -> Mesh:
    """A palm frond: an arching rib with leaflets that hang from it on both sides."""
    out = np.array([np.cos(turn_rad), np.sin(turn_rad), 0.0])
    side = np.array([-out[1], out[0], 0.0])
    share = np.linspace(0.0, 1.0, _LEAFLETS + 1)[:, None]
    arch = out * share * (1.0 - 0.25 * share) + [0.0, 0.0, 1.0] * (rise * share - (0.75 + 0.4 * rise) * share**2)
    rib = root_m + rng.uniform(2.2, 2.7) * arch
    length_m = (0.75 * np.sin(np.pi * (0.12 + 0.8 * share[1:])) + 0.12) * rng.uniform(0.9, 1.1, (_LEAFLETS, 1))
    tips = [rib[1:] + length_m * (sign * 0.75 * side + 0.45 * out - [0.0, 0.0, 0.45]) for sign in (1.0, -1.0)]
    corners = np.concatenate([np.stack([rib[:-1], rib[1:], tip], axis=1) for tip in tips])
    corners[_LEAFLETS:] = corners[_LEAFLETS:, [1, 0, 2]]
    return blades(rng, corners, root_m - [0.0, 0.0, 1.0], color)


def _high_crowned(
    rng: np.random.Generator,
    variety: float,
    heights_m: tuple[float, float],
    crown_at: float,
    trunk_m: tuple[float, float],
    crown_m: tuple[float, float, float],
    sprigs: int,
) -> GradedMesh:
    """A conifer with a leaning bare trunk (bottom and top radius) and a crown centered at a fraction of its height."""
    color, height_m = pick_color(rng, "needles", variety), rng.uniform(*heights_m)
    lean = rng.normal(0.0, 0.3, 2)
    spine = np.array([[0.0, 0.0, ROOT_M], [*lean * 0.5, height_m * 0.5], [*lean, height_m * (crown_at + 0.01)]])
    middle = np.array([*lean, height_m * crown_at])
    return GradedMesh.merge([trunk(rng, spine, *trunk_m), crown(rng, middle, np.array(crown_m), sprigs, color)])
