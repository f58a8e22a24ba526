"""Windows in facades: most of the light passes the pane, and what comes back comes from curtains or from rooms.

Openings are those that cameras see (``shade_wall.frag.glsl``), in bays of three meters; buildings differ less here.
Most windows have a curtain or blind behind the pane; in other rooms, walls and furniture return light from some depth.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from simbev_ros.assets.materials import Material, load_materials
from simbev_ros.foundation.types import Float32Array, Float64Array, Int64Array
from simbev_ros.simulation.raycast.scene import Hits, RayScene

_BAY_M = 3.0
_OPENINGS_M = {
    # left and right end, sill and lintel, in the bay; depth of the pane behind the wall
    Material.FACADE: (0.85, 2.15, 0.85, 2.40, 0.18),
    Material.BRICK_FACADE: (0.85, 2.15, 0.85, 2.40, 0.18),
    Material.TIMBER_FACADE: (1.00, 2.00, 0.85, 2.25, 0.06),
    Material.CONCRETE_FACADE: (0.25, 2.75, 0.90, 2.45, 0.16),
    Material.METAL_FACADE: (0.00, 3.00, 1.20, 2.30, 0.06),
}
_CURTAINED_SHARE = 0.6
_CURTAIN_REFLECTANCE, _ROOM_REFLECTANCE = 0.4, 0.3
_ROOM_M = 2.0  # mean depth of what stands in rooms


@dataclass(frozen=True, slots=True)
class Windows:
    """W rays that first hit windows.

    Attributes:
        ray: (W,) the rays, ascending.
        pane_m: (W,) depth of the pane and of its curtain behind the wall.
        curtain: (W,) reflectance of the curtain, through the pane; 0: there is none.
        room_m: (W,) depth of what stands in the room behind the pane.
        room: (W,) reflectance of that, through the pane; 0: there is a curtain.
    """

    ray: Int64Array
    pane_m: Float32Array
    curtain: Float32Array
    room_m: Float32Array
    room: Float32Array


def find_windows(scene: RayScene, hits: Hits) -> Windows:
    """Windows among (N,) hits of the scene since its last update."""
    opening_m = _openings()
    walls = np.flatnonzero((opening_m[:, 1] > 0.0).take(hits.material) & (hits.row < 0))
    along_m, up_m = scene.surface_coordinates(hits.triangle.take(walls), hits.barycentric.take(walls, axis=0)).T
    left_m, right_m, sill_m, lintel_m, pane_m = opening_m.take(hits.material.take(walls), axis=0).T
    along, up = along_m % _BAY_M, up_m % _BAY_M
    inside = (along > left_m) & (along < right_m) & (up > sill_m) & (up < lintel_m) & (up_m > 0.0)
    draw = _uniform(along_m[inside], up_m[inside])
    is_curtain = draw < _CURTAINED_SHARE
    room_m = -_ROOM_M * np.log1p(-np.maximum(draw - _CURTAINED_SHARE, 0.0) / (1.0 - _CURTAINED_SHARE))
    passed = load_materials().lidar_transmission[Material.GLASS] ** 2
    curtain, room = (
        np.where(there, passed * reflectance, 0.0).astype(np.float32)
        for there, reflectance in ((is_curtain, _CURTAIN_REFLECTANCE), (~is_curtain, _ROOM_REFLECTANCE))
    )
    return Windows(walls[inside], pane_m[inside], curtain, room_m.astype(np.float32), room)


@lru_cache(maxsize=1)
def _openings() -> Float32Array:
    """(materials, 5) ``_OPENINGS_M`` by material, zeros for those without windows."""
    table = np.zeros((len(Material), 5), np.float32)
    for material, opening_m in _OPENINGS_M.items():
        table[material] = opening_m
    return table


def _uniform(along_m: Float32Array, up_m: Float32Array) -> Float64Array:
    """(W,) numbers in 0..1 by bay: multiplicative hashes."""
    column, story = (np.floor(each / _BAY_M).astype(np.int64) for each in (along_m, up_m))
    mixed = (column * 0x9E3779B1 + story * 0x85EBCA77) & 0xFFFFFFFF
    return ((mixed ^ (mixed >> 15)) * 0x2C1B3C6D & 0xFFFFFF) / float(1 << 24)
