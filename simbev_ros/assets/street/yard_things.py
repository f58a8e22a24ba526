"""Meshes of objects in yards. Frame: origin at the foot, x forward, z up. Each is built once and copied."""

from functools import lru_cache

import numpy as np

from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.mesh.primitives import Finish, box, boxes, cylinder
from simbev_ros.assets.palette import Color
from simbev_ros.foundation.semantics import Tag

_RUBBER = Finish(Material.RUBBER, Tag.DYNAMIC, (28, 28, 30))


@lru_cache(maxsize=8)
def trailer(color: Color) -> Mesh:
    """A parked semi-trailer, 12 m long, its doors at -x."""
    body, frame = Finish(Material.METAL, Tag.DYNAMIC, color), Finish(Material.METAL, Tag.DYNAMIC, (46, 48, 50))
    axles_m = (-4.6, -3.4, -2.2)
    wheels = [
        cylinder(_RUBBER, (x, side * 0.85, 0.5), (x, side * 1.22, 0.5), 0.5, segments=10)
        for x in axles_m
        for side in (-1, 1)
    ]
    legs = np.array([[3.2, -0.7, 0.55], [3.2, 0.7, 0.55]])
    doors = np.array([[-6.03, -0.62, 2.5], [-6.03, 0.62, 2.5]])
    return Mesh.merge(
        [
            box(body, (12.0, 2.5, 2.7), (0.0, 0.0, 2.5)),
            box(frame, (11.8, 1.2, 0.3), (0.0, 0.0, 1.0)),
            boxes(frame, np.tile((0.16, 0.16, 1.1), (2, 1)), legs),
            boxes(frame, np.tile((0.04, 0.05, 2.5), (2, 1)), doors),
            *wheels,
        ]
    )


@lru_cache(maxsize=8)
def container(color: Color) -> Mesh:
    """A freight container, 6 m long."""
    steel = Finish(Material.METAL, Tag.DYNAMIC, color)
    x_m = np.arange(-2.7, 2.8, 0.6)
    ribs = np.array([(x, side * 1.22, 1.3) for x in x_m for side in (-1, 1)])
    return Mesh.merge(
        [
            box(steel, (6.05, 2.4, 2.75), (0.0, 0.0, 1.225)),
            boxes(steel, np.tile((0.2, 0.06, 2.3), (len(ribs), 1)), ribs),
        ]
    )


@lru_cache(maxsize=8)
def dumpster(color: Color) -> Mesh:
    """A wheeled waste container with sloping lids, 1.8 m wide."""
    steel, lid = Finish(Material.METAL, Tag.DYNAMIC, color), Finish(Material.PLASTIC, Tag.DYNAMIC, (40, 42, 44))
    return Mesh.merge(
        [
            box(steel, (1.1, 1.8, 1.15), (0.0, 0.0, 0.72), bevel_m=0.05),
            box(lid, (1.2, 1.85, 0.08), (0.0, 0.0, 1.33)),
            boxes(
                _RUBBER,
                np.tile((0.16, 0.08, 0.3), (4, 1)),
                np.array([(x, y, 0.1) for x in (-0.4, 0.4) for y in (-0.7, 0.7)]),
            ),
        ]
    )


@lru_cache(maxsize=4)
def wheelie_bin(color: Color) -> Mesh:
    """A household bin on wheels, 1.05 m high."""
    plastic = Finish(Material.PLASTIC, Tag.DYNAMIC, color)
    axle = cylinder(_RUBBER, (-0.24, -0.26, 0.1), (-0.24, 0.26, 0.1), 0.1, segments=8)
    return Mesh.merge(
        [box(plastic, (0.52, 0.48, 1.12), (0.0, 0.0, 0.41)), box(plastic, (0.6, 0.54, 0.07), (0.0, 0.0, 1.0)), axle]
    )


@lru_cache(maxsize=1)
def pallets() -> Mesh:
    """A stack of pallets with a crate on it."""
    wood, crate = Finish(Material.WOOD, Tag.DYNAMIC, (168, 134, 88)), Finish(Material.WOOD, Tag.DYNAMIC, (140, 108, 72))
    decks = np.array([(0.0, 0.0, z) for z in (0.12, 0.27, 0.42, 0.57)])
    blocks = np.array([(x, y, 0.22) for x in (-0.5, 0.0, 0.5) for y in (-0.35, 0.35)])
    return Mesh.merge(
        [
            boxes(wood, np.tile((1.2, 0.8, 0.04), (4, 1)), decks),
            boxes(wood, np.tile((0.12, 0.12, 0.86), (6, 1)), blocks),
            box(crate, (1.0, 0.7, 0.6), (0.05, 0.0, 0.94)),
        ]
    )


@lru_cache(maxsize=1)
def hay_bale() -> Mesh:
    """A round bale lying on its side."""
    straw = Finish(Material.CLOTH, Tag.OTHER, (176, 150, 92))
    return cylinder(straw, (0.0, -0.6, 0.68), (0.0, 0.6, 0.68), 0.72, segments=12)


@lru_cache(maxsize=1)
def wood_pile() -> Mesh:
    """Cut logs stacked between posts, 3 m long."""
    bark, post = Finish(Material.BARK, Tag.OTHER, (120, 92, 66)), Finish(Material.WOOD, Tag.OTHER, (96, 78, 58))
    rows = [(0.0, 0.17), (0.0, 0.5), (0.33, 0.17), (-0.33, 0.17), (0.17, 0.36), (-0.17, 0.36), (0.0, 0.68)]
    logs = [cylinder(bark, (-1.5, y, z), (1.5, y, z), 0.17, segments=6) for y, z in rows]
    posts = np.array([(x, y, 0.35) for x in (-1.2, 1.2) for y in (-0.56, 0.56)])
    return Mesh.merge([*logs, boxes(post, np.tile((0.1, 0.1, 1.1), (4, 1)), posts)])
