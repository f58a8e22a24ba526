"""Street furniture. Frame: origin at the foot, x towards the road, z up."""

import numpy as np

from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh import Mesh
from simbev_ros.assets.palette import Color
from simbev_ros.assets.primitives import Finish, box, cylinder, lathe, tube
from simbev_ros.semantics import Tag

LAMP_AT_M = (1.75, 0.0, 7.82)
"""Light source of ``street_light``, its own frame."""

_BEND_RAD = np.linspace(0.0, np.pi / 2.0, 3)
_STEEL = (104, 108, 111)


def street_light() -> Mesh:
    """A street light, 8 m high, with an arm over the road; its lamp's ``uv`` is to be set with ``with_lamp_index``."""
    pole = Finish(Material.METAL, Tag.POLE, _STEEL)
    bend = np.column_stack([0.55 * (1.0 - np.cos(_BEND_RAD)), np.zeros(3), 7.4 + 0.5 * np.sin(_BEND_RAD)])
    path = np.concatenate([[[0.0, 0.0, 0.0]], bend, [[1.5, 0.0, 7.95]]])
    x_m, y_m, z_m = LAMP_AT_M
    return Mesh.merged(
        [
            lathe(pole, np.array([[0.15, 0.0], [0.15, 0.7], [0.085, 0.9]]), segments=6),
            tube(pole, path, np.array([0.085, 0.06, 0.055, 0.05, 0.045]), segments=6),
            box(pole, (0.8, 0.28, 0.12), (x_m, y_m, z_m + 0.12)),
            box(Finish(Material.STREET_LAMP, Tag.POLE, (238, 232, 214)), (0.6, 0.2, 0.08), (x_m, y_m, z_m + 0.03)),
        ]
    )


def with_lamp_index(mesh: Mesh, lamps: tuple[Material, ...], index: int) -> Mesh:
    """A copy whose lamps of the given materials carry an index in ``uv``."""
    copy = mesh.transformed(np.eye(4))
    uv = copy.uv.copy()
    uv[np.isin(copy.material, lamps)] = (index, 0.0)
    return Mesh(copy.vertices, copy.normals, uv, copy.color, copy.material, copy.tag, copy.part, copy.triangles)


def bench() -> Mesh:
    """A park bench, 1.8 m long, to be sat on facing x."""
    wood, iron = Finish(Material.WOOD, Tag.STATIC, (124, 88, 56)), Finish(Material.METAL, Tag.STATIC, (52, 54, 56))
    planks = [box(wood, (0.13, 1.8, 0.04), (x_m, 0.0, 0.45)) for x_m in (-0.15, 0.0, 0.15)]
    back = [box(wood, (0.04, 1.8, 0.12), (-0.27 - 0.02 * k, 0.0, 0.62 + 0.17 * k)) for k in range(2)]
    legs = [box(iron, (0.42, 0.06, 0.43), (0.0, y_m, 0.215)) for y_m in (-0.7, 0.7)]
    posts = [box(iron, (0.05, 0.06, 0.45), (-0.27, y_m, 0.65)) for y_m in (-0.7, 0.7)]
    return Mesh.merged([*planks, *back, *legs, *posts])


def litter_bin(color: Color) -> Mesh:
    """A litter bin, 1 m high."""
    metal = Finish(Material.METAL, Tag.STATIC, color)
    profile = np.array([[0.2, 0.0], [0.24, 0.05], [0.26, 0.82], [0.28, 0.88], [0.2, 1.0], [0.0, 1.03]])
    return lathe(metal, profile, segments=8)


def hydrant() -> Mesh:
    """A fire hydrant, 0.8 m high."""
    red = Finish(Material.METAL, Tag.STATIC, (176, 40, 32))
    profile = np.array([[0.19, 0.0], [0.12, 0.08], [0.12, 0.55], [0.16, 0.6], [0.06, 0.76]])
    outlets = [cylinder(red, (0.0, -0.22, 0.42), (0.0, 0.22, 0.42), 0.06, segments=6)]
    outlets.append(cylinder(red, (0.0, 0.0, 0.4), (0.21, 0.0, 0.4), 0.08, segments=8))
    return Mesh.merged([lathe(red, profile, segments=8), *outlets])


def bus_shelter() -> Mesh:
    """A bus shelter of glass, 4 m along the road and 1.5 m deep, open towards x."""
    steel, glass = Finish(Material.METAL, Tag.STATIC, (66, 70, 74)), Finish(Material.GLASS, Tag.STATIC, (150, 172, 178))
    posts = [box(steel, (0.08, 0.08, 2.4), (x_m, y_m, 1.2)) for x_m in (-0.7, 0.6) for y_m in (-1.95, 1.95)]
    panes = [box(glass, (0.03, 3.8, 1.9), (-0.7, 0.0, 1.2))]
    panes += [box(glass, (1.2, 0.03, 1.9), (-0.05, y_m, 1.2)) for y_m in (-1.95, 1.95)]
    poster = box(Finish(Material.PLASTIC, Tag.STATIC, (214, 176, 96)), (0.8, 0.08, 1.3), (-0.1, 1.95, 1.25))
    seat = box(Finish(Material.WOOD, Tag.STATIC, (128, 96, 64)), (0.4, 3.0, 0.06), (-0.42, 0.0, 0.48))
    feet = [box(steel, (0.06, 0.06, 0.45), (-0.42, y_m, 0.225)) for y_m in (-1.3, 1.3)]
    roof = box(steel, (1.7, 4.2, 0.12), (-0.05, 0.0, 2.46), bevel_m=0.04)
    floor = box(Finish(Material.CONCRETE, Tag.STATIC, (140, 137, 130)), (1.8, 4.2, 0.3), (-0.05, 0.0, -0.13))
    return Mesh.merged([floor, roof, *posts, *panes, poster, seat, *feet])


def fence(length_m: float) -> Mesh:
    """A wooden fence of pickets, 1.1 m high, along x from 0."""
    wood = Finish(Material.WOOD, Tag.FENCE, (196, 186, 168))
    posts = np.linspace(0.06, length_m - 0.06, max(2, round(length_m / 2.2) + 1))
    rails = [box(wood, (length_m, 0.03, 0.08), (length_m / 2.0, 0.03, z_m)) for z_m in (0.3, 0.85)]
    pickets = np.arange(0.15, length_m - 0.1, 0.34)
    return Mesh.merged(
        [
            *rails,
            *(box(wood, (0.1, 0.1, 1.3), (float(x_m), 0.0, 0.45)) for x_m in posts),
            *(_picket(wood, float(x_m)) for x_m in pickets),
        ]
    )


def garden_wall(length_m: float, color: Color) -> Mesh:
    """A brick wall with a coping, 1.6 m high, along x from 0."""
    brick, stone = Finish(Material.BRICK, Tag.WALL, color), Finish(Material.CONCRETE, Tag.WALL, (156, 152, 144))
    return Mesh.merged(
        [
            box(brick, (length_m, 0.22, 1.8), (length_m / 2.0, 0.0, 0.6)),
            box(stone, (length_m + 0.06, 0.3, 0.08), (length_m / 2.0, 0.0, 1.54)),
        ]
    )


def _picket(wood: Finish, x_m: float) -> Mesh:
    return box(wood, (0.09, 0.025, 1.0), (x_m, 0.0, 0.58))
