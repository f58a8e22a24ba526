"""Meshes of street furniture. Frame: origin at the foot, x toward the road, z up. Each is built once and copied."""

from functools import lru_cache

import numpy as np

from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.mesh.primitives import Finish, box, boxes, cylinder, lathe
from simbev_ros.assets.palette import Color
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Float64Array

FOOT_M = 0.25
"""Depth to which feet reach into the ground, for slopes."""


@lru_cache(maxsize=1)
def bench() -> Mesh:
    """A park bench, 1.8 m long; its seat faces x."""
    wood, iron = Finish(Material.WOOD, Tag.STATIC, (124, 88, 56)), Finish(Material.METAL, Tag.STATIC, (52, 54, 56))
    planks = np.array([[-0.15, 0.0, 0.43], [0.0, 0.0, 0.43], [0.15, 0.0, 0.43]])
    back = np.array([[-0.27, 0.0, 0.62], [-0.29, 0.0, 0.79]])
    legs = np.array([[0.0, -0.7, 0.21 - FOOT_M / 2.0], [0.0, 0.7, 0.21 - FOOT_M / 2.0]])
    posts = np.array([[-0.27, -0.7, 0.65], [-0.27, 0.7, 0.65]])
    return Mesh.merge(
        [
            boxes(wood, np.tile((0.13, 1.8, 0.04), (3, 1)), planks),
            boxes(wood, np.tile((0.04, 1.8, 0.12), (2, 1)), back),
            boxes(iron, np.tile((0.42, 0.06, 0.42 + FOOT_M), (2, 1)), legs),
            boxes(iron, np.tile((0.05, 0.06, 0.45), (2, 1)), posts),
        ]
    )


@lru_cache(maxsize=8)
def litter_bin(color: Color) -> Mesh:
    """A litter bin, 1 m high."""
    metal = Finish(Material.METAL, Tag.STATIC, color)
    profile = np.array([[0.2, -FOOT_M], [0.24, 0.05], [0.26, 0.82], [0.28, 0.88], [0.2, 1.0], [0.0, 1.03]])
    return lathe(metal, profile, segments=8)


@lru_cache(maxsize=1)
def hydrant() -> Mesh:
    """A fire hydrant, 0.8 m high."""
    red = Finish(Material.METAL, Tag.STATIC, (176, 40, 32))
    profile = np.array([[0.19, -FOOT_M], [0.19, 0.0], [0.12, 0.08], [0.12, 0.55], [0.16, 0.6], [0.06, 0.76]])
    outlets = [cylinder(red, (0.0, -0.22, 0.42), (0.0, 0.22, 0.42), 0.06, segments=6)]
    outlets.append(cylinder(red, (0.0, 0.0, 0.4), (0.21, 0.0, 0.4), 0.08, segments=8))
    return Mesh.merge([lathe(red, profile, segments=8), *outlets])


@lru_cache(maxsize=1)
def bus_shelter() -> Mesh:
    """A bus shelter of glass, 4 m along the road and 1.5 m deep, open towards x."""
    steel, glass = Finish(Material.METAL, Tag.STATIC, (66, 70, 74)), Finish(Material.GLASS, Tag.STATIC, (150, 172, 178))
    posts = np.array([[x, y, 1.2] for x in (-0.7, 0.6) for y in (-1.95, 1.95)])
    sides = np.array([[-0.05, -1.95, 1.2], [-0.05, 1.95, 1.2]])
    feet = np.array([[-0.42, -1.3, 0.21], [-0.42, 1.3, 0.21]])
    return Mesh.merge(
        [
            box(Finish(Material.CONCRETE, Tag.STATIC, (140, 137, 130)), (1.8, 4.2, 0.62), (-0.05, 0.0, -0.29)),
            box(steel, (1.7, 4.2, 0.12), (-0.05, 0.0, 2.46), bevel_m=0.04),
            boxes(steel, np.tile((0.08, 0.08, 2.4), (4, 1)), posts),
            box(glass, (0.03, 3.8, 1.9), (-0.7, 0.0, 1.2)),
            boxes(glass, np.tile((1.2, 0.03, 1.9), (2, 1)), sides),
            box(Finish(Material.PLASTIC, Tag.STATIC, (214, 176, 96)), (0.8, 0.08, 1.3), (-0.1, 1.95, 1.25)),
            box(Finish(Material.WOOD, Tag.STATIC, (128, 96, 64)), (0.4, 3.0, 0.06), (-0.42, 0.0, 0.44)),
            boxes(steel, np.tile((0.06, 0.06, 0.42), (2, 1)), feet),
        ]
    )


@lru_cache(maxsize=1)
def mailbox() -> Mesh:
    """A mailbox on a post, 1.2 m high, its flap towards x."""
    wood, tin = Finish(Material.WOOD, Tag.STATIC, (116, 92, 66)), Finish(Material.METAL, Tag.STATIC, (86, 94, 104))
    flag = Finish(Material.METAL, Tag.STATIC, (186, 44, 36))
    return Mesh.merge(
        [
            box(wood, (0.1, 0.1, 1.0 + FOOT_M), (0.0, 0.0, 0.5 - FOOT_M / 2.0)),
            box(tin, (0.48, 0.2, 0.24), (0.0, 0.0, 1.1), bevel_m=0.05),
            box(flag, (0.04, 0.02, 0.16), (0.1, 0.11, 1.2)),
        ]
    )


@lru_cache(maxsize=1)
def cabinet() -> Mesh:
    """A telephone or power cabinet, 1.2 m high."""
    shell = Finish(Material.METAL, Tag.OTHER, (142, 148, 142))
    foot = Finish(Material.CONCRETE, Tag.OTHER, (128, 126, 120))
    return Mesh.merge(
        [
            box(foot, (0.4, 0.95, 0.12 + FOOT_M), (0.0, 0.0, 0.06 - FOOT_M / 2.0)),
            box(shell, (0.36, 0.9, 1.05), (0.0, 0.0, 0.64), bevel_m=0.02),
            box(shell, (0.42, 0.96, 0.06), (0.0, 0.0, 1.19)),
        ]
    )


@lru_cache(maxsize=1)
def bicycle_rack() -> Mesh:
    """Two hoops in a row along y, and the bicycles that are locked to them."""
    steel = Finish(Material.METAL, Tag.STATIC, (150, 153, 156))
    y_m = (-1.05, 1.05)
    posts = np.array([(0.0, y + side, 0.3) for y in y_m for side in (-0.35, 0.35)])
    rails = np.array([(0.0, y, 0.82) for y in y_m])
    hoops = [
        boxes(steel, np.tile((0.05, 0.05, 1.1), (4, 1)), posts),
        boxes(steel, np.tile((0.05, 0.75, 0.05), (2, 1)), rails),
    ]
    bicycles = [_parked_bicycle(y, color) for y, color in zip(y_m, ((38, 60, 96), (120, 36, 34)), strict=True)]
    return Mesh.merge([*hoops, *bicycles])


def _parked_bicycle(y_m: float, color: Color) -> Mesh:
    """A low-polygon bicycle along y, beside its hoop."""
    rubber, frame = Finish(Material.RUBBER, Tag.DYNAMIC, (28, 28, 30)), Finish(Material.METAL, Tag.DYNAMIC, color)
    x_m = -0.14
    tire = np.array([[0.29, 0.0], [0.33, -0.02], [0.35, 0.0], [0.33, 0.02], [0.29, 0.0]])
    wheels = [
        lathe(rubber, tire, segments=12, caps=False).transform(_along_x(x_m, y_m + side, 0.34))
        for side in (-0.52, 0.52)
    ]
    bars = [
        ((-0.52, 0.34), (-0.15, 0.8)),
        ((-0.52, 0.34), (-0.1, 0.32)),
        ((-0.1, 0.32), (-0.18, 0.88)),
        ((-0.15, 0.8), (0.4, 0.78)),
        ((-0.1, 0.32), (0.4, 0.78)),
        ((0.38, 0.98), (0.52, 0.34)),
    ]
    tubes = [
        cylinder(frame, (x_m, y_m + start, low), (x_m, y_m + end, high), 0.022, segments=4)
        for (start, low), (end, high) in bars
    ]
    saddle = box(rubber, (0.14, 0.26, 0.06), (x_m, y_m - 0.18, 0.9))
    return Mesh.merge([*wheels, *tubes, saddle, box(frame, (0.46, 0.05, 0.04), (x_m, y_m + 0.4, 0.98))])


def _along_x(x_m: float, y_m: float, z_m: float) -> Float64Array:
    """(4, 4) pose that turns an object's z axis into x and moves it."""
    return np.array([[0.0, 0.0, 1.0, x_m], [1.0, 0.0, 0.0, y_m], [0.0, 1.0, 0.0, z_m], [0.0, 0.0, 0.0, 1.0]])
