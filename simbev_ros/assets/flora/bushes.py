"""Generates meshes of bushes, hedges, cacti and thickets. Frame: origin at the foot, z up."""

from collections.abc import Mapping

import numpy as np

from simbev_ros.assets.flora.crowns import ROOT_M, blossom, clump, crown, leaves
from simbev_ros.assets.flora.deciduous import Deciduous, Limbs, dress
from simbev_ros.assets.flora.skeleton import Crown, limbs_of_stem
from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.graded import GradedMesh
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.mesh.primitives import Finish, lathe, loft, tube
from simbev_ros.assets.palette import pick_color, shade_color
from simbev_ros.config.weather import Season
from simbev_ros.foundation.semantics import Tag

_THICKETS: Mapping[Season, str] = {
    "spring": "fresh_leaves",
    "summer": "broad_leaves",
    "autumn": "autumn_leaves",
    "winter": "bare_woods",
}


class Shrub(Deciduous):
    """Size and leaves of a shrub; species.yaml explains the fields."""

    radii_m: tuple[float, float, float]
    evergreen: bool = False
    flowers: float = 0.0


def shrub(rng: np.random.Generator, kind: Shrub, season: Season) -> GradedMesh:
    """Generate a shrub: a ball of leaves on the ground, or stems with branches when it is bare."""
    radii_m = np.array(kind.radii_m) * rng.uniform(0.85, 1.15, 3)
    middle_m = np.array([0.0, 0.0, 0.75 * radii_m[2]])
    if season == "summer" or kind.evergreen:
        color = pick_color(rng, kind.leaves, 0.15)
        leafage = crown(rng, middle_m, radii_m, 44, color, lobes=2, cover=0.4, coarse_detail=0)
        if rng.random() >= kind.flowers:
            return leafage
        flower = pick_color(rng, "flowers", 0.15)
        return GradedMesh.merge([leafage, GradedMesh(blossom(rng, middle_m, radii_m, 40, flower), Mesh.empty())])
    held, bark = Crown(middle_m, radii_m), pick_color(rng, "barks")
    shoots = limbs_of_stem(rng, kind, held, np.array([0.0, 0.0, -0.05]), 0.025)
    return dress(rng, kind, Limbs(shoots, held, bark), 110, season)


def cactus(rng: np.random.Generator) -> Mesh:
    """Generate a columnar cactus with arms, about 3.5 m high."""
    flesh = Finish(Material.PLAIN, Tag.VEGETATION, pick_color(rng, "cacti", 0.1))
    height_m = rng.uniform(2.4, 4.2)
    profile = [[0.2, ROOT_M], [0.26, 0.6], [0.25, height_m - 0.3], [0.14, height_m - 0.06], [0.0, height_m]]
    pieces = [lathe(flesh, np.array(profile), segments=8)]
    for turn in rng.uniform(0.0, 2.0 * np.pi) + np.arange(int(rng.integers(0, 3))) * 2.6:
        out, low_m = np.array([np.cos(turn), np.sin(turn)]), height_m * rng.uniform(0.35, 0.5)
        path = [[0.0, 0.0, low_m], [*out * 0.6, low_m + 0.1], [*out * 0.75, low_m + height_m * 0.32]]
        pieces.append(tube(flesh, np.array(path), np.array([0.13, 0.15, 0.12]), segments=6))
    return Mesh.merge(pieces)


def agave(rng: np.random.Generator) -> Mesh:
    """Generate a rosette of stiff leaves, about 0.9 m high."""
    flesh = Finish(Material.PLAIN, Tag.VEGETATION, pick_color(rng, "cacti", 0.12))
    turns = np.arange(9) * 2.4 + rng.uniform(0.0, 6.0)
    pieces = []
    for turn, rise_m in zip(turns, rng.uniform(0.3, 0.9, len(turns)), strict=True):
        out = np.array([np.cos(turn), np.sin(turn)]) * (1.05 - 0.6 * rise_m)
        pieces.append(tube(flesh, np.array([[0.0, 0.0, 0.0], [*out, rise_m]]), np.array([0.13, 0.01]), segments=3))
    return Mesh.merge(pieces)


def thicket(rng: np.random.Generator, season: Season) -> Mesh:
    """Generate a patch of distant forest, about 10 m high and 12 m wide, for distant views only."""
    color = pick_color(rng, "needles" if rng.random() < 0.3 else _THICKETS[season], 0.1)
    sizes = rng.uniform((3.0, 3.0, 4.0), (5.0, 5.0, 7.5), (3, 3))
    centers = np.column_stack([rng.uniform(-4.5, 4.5, (3, 2)), sizes[:, 2] * rng.uniform(0.5, 0.8, 3)])
    roots = np.array([0.0, 0.0, -4.0])
    tones = rng.uniform(0.75, 1.0, 3)
    balls = [
        clump(rng, center, size, roots, shade_color(color, tone), irregularity=0.18)
        for center, size, tone in zip(centers, sizes, tones, strict=True)
    ]
    return Mesh.merge(balls)


def hedge(rng: np.random.Generator, length_m: float, leafage: str = "hedges", height_m: float = 1.3) -> GradedMesh:
    """Generate a clipped hedge along x from 0, 0.7 m wide, with an uneven top, in a color of a palette."""
    stations = np.linspace(0.0, length_m, round(length_m / 0.4) + 1)
    outline = [[-0.33, -0.3], [0.33, -0.3], [0.36, 0.6], [0.3, 0.9], [0.0, 1.0], [-0.3, 0.9], [-0.36, 0.6]]
    sections = np.empty((len(stations), len(outline), 3))
    sections[..., 0] = stations[:, None]
    sections[..., 1:] = np.array(outline) * [1.0, height_m]
    finish = leaves(pick_color(rng, leafage, 0.1))
    coarse = loft(finish, sections[[0, -1]], crease_deg=60.0)
    sections[1:-1, 2:] += rng.normal(0.0, 0.045, (len(stations) - 2, len(outline) - 2, 3))
    return GradedMesh(loft(finish, sections, crease_deg=60.0), coarse)
