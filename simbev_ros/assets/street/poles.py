"""Meshes of street lights, masts, utility poles and cables. Frame: origin at the foot, x toward the road, z up."""

from dataclasses import replace
from functools import lru_cache

import numpy as np

from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.mesh.primitives import Finish, box, boxes, cylinder, lathe, tube
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Float64Array

STREET_LAMP_AT_M = (1.75, 0.0, 7.82)
"""Position of the light source of ``street_light``, in its own frame."""
MAST_LAMP_AT_M = (2.6, 0.0, 11.82)
"""Position of the light source of ``mast``, in its own frame."""
CABLE_AT_M = 7.6
"""Height of the cables at a utility pole."""

_BEND_RAD = np.linspace(0.0, np.pi / 2.0, 3)
_STEEL = (104, 108, 111)
_ROOT_M = -0.5
_CABLE_OUT_M = (-0.85, 0.85)
_SAG = 0.02


@lru_cache(maxsize=1)
def street_light() -> Mesh:
    """A street light, 8 m high, with an arm over the road; set its lamp's ``uv`` with ``with_lamp_index``."""
    return _light(STREET_LAMP_AT_M, 0.085)


@lru_cache(maxsize=1)
def mast() -> Mesh:
    """A motorway light mast, 12 m high, with a long arm."""
    return _light(MAST_LAMP_AT_M, 0.11)


def with_lamp_index(mesh: Mesh, lamps: tuple[Material, ...], index: int) -> Mesh:
    """Copy of a mesh whose lamps of the given materials have an index in ``uv``."""
    uv = mesh.uv.copy()
    uv[np.isin(mesh.material, lamps)] = (index, 0.0)
    return replace(mesh, uv=uv)


@lru_cache(maxsize=1)
def utility_pole() -> Mesh:
    """A wooden pole with a cross-arm and insulators; cables run along y."""
    wood, glass = Finish(Material.WOOD, Tag.POLE, (104, 84, 64)), Finish(Material.GLASS, Tag.POLE, (120, 140, 136))
    centers_m = np.array([(x, 0.0, CABLE_AT_M - 0.08) for x in _CABLE_OUT_M])
    return Mesh.merge(
        [
            cylinder(wood, (0.0, 0.0, _ROOT_M), (0.0, 0.0, 8.4), 0.15, end_radius_m=0.1, segments=6),
            box(wood, (2.0, 0.12, 0.12), (0.0, 0.0, CABLE_AT_M - 0.2)),
            boxes(glass, np.tile((0.09, 0.09, 0.16), (2, 1)), centers_m),
        ]
    )


def cables(foot_m: Float64Array, next_foot_m: Float64Array, across: Float64Array) -> Mesh:
    """Build two cables that hang between utility poles.

    Args:
        foot_m: (3,) foot of one pole, map frame.
        next_foot_m: (3,) foot of the other pole.
        across: (2,) unit direction of the cross-arms.

    Returns:
        Mesh of the cables relative to ``foot_m``.
    """
    black = Finish(Material.RUBBER, Tag.POLE, (34, 34, 36))
    share = np.linspace(0.0, 1.0, 6)
    line = share[:, None] * (next_foot_m - foot_m) + [0.0, 0.0, CABLE_AT_M]
    line[:, 2] -= 4.0 * _SAG * share * (1.0 - share) * float(np.linalg.norm(next_foot_m - foot_m))
    cable = tube(black, line, 0.02, segments=3, crease_deg=180.0)
    poses = np.tile(np.eye(4), (len(_CABLE_OUT_M), 1, 1))
    poses[:, :2, 3] = np.outer(_CABLE_OUT_M, across)
    return Mesh.merge(cable.copies(poses))


def _light(lamp_at_m: tuple[float, float, float], radius_m: float) -> Mesh:
    x_m, y_m, z_m = lamp_at_m
    pole = Finish(Material.METAL, Tag.POLE, _STEEL)
    bend = np.column_stack([0.55 * (1.0 - np.cos(_BEND_RAD)), np.zeros(3), z_m - 0.42 + 0.5 * np.sin(_BEND_RAD)])
    path = np.concatenate([[[0.0, 0.0, 0.0]], bend, [[x_m - 0.25, 0.0, z_m + 0.13]]])
    foot = np.array([[radius_m + 0.065, _ROOT_M], [radius_m + 0.065, 0.7], [radius_m, 0.9]])
    return Mesh.merge(
        [
            lathe(pole, foot, segments=6),
            tube(pole, path, radius_m * np.array([1.0, 0.7, 0.65, 0.6, 0.53]), segments=6),
            box(pole, (0.8, 0.28, 0.12), (x_m, y_m, z_m + 0.12)),
            box(Finish(Material.STREET_LAMP, Tag.POLE, (238, 232, 214)), (0.6, 0.2, 0.08), (x_m, y_m, z_m + 0.03)),
        ]
    )
