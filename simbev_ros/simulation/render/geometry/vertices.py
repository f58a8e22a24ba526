"""Packs meshes for the GPU, 32 bytes per vertex; shaders/include/vertex.glsl unpacks them."""

import numpy as np

from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.foundation.types import Float32Array, Table, UInt32Array
from simbev_ros.simulation.render.shading.surfaces import shading_flag_of_material

VERTEX_DTYPE = np.dtype([("in_position", "<f4", 3), ("in_uv", "<f4", 2), ("in_packed", "<u4", 3)])

_MATERIALS = np.arange(256)
_SHADING_FLAG = shading_flag_of_material().astype(np.uint32)
_TINTS = (
    (Material.CAR_PAINT, Material.CLOTH_TINTED),
    (Material.SKIN,),
    (Material.HAIR,),
    (Material.CLOTH_SECOND,),
    (Material.LEATHER,),
)
"""Materials whose albedo is multiplied by the actor's color (tint 1), or by one of its row's further tints (2 to 5)."""
_TINT = np.zeros(256, np.uint32)
for _tint, _materials in enumerate(_TINTS, start=1):
    _TINT[list(_materials)] = _tint
_LIFTED = (_MATERIALS == Material.MARKING).astype(np.uint32)


def pack_vertices(mesh: Mesh) -> Table:
    """(V,) ``VERTEX_DTYPE`` vertices as the geometry shaders read them."""
    vertices = np.empty(len(mesh.vertices), VERTEX_DTYPE)
    vertices["in_position"] = mesh.vertices
    vertices["in_uv"] = mesh.uv
    material, tag, part = (column.astype(np.uint32) for column in (mesh.material, mesh.tag, mesh.part))
    red, green, blue = mesh.color.astype(np.uint32).T
    flags = _TINT[mesh.material] | _LIFTED[mesh.material] << 3
    vertices["in_packed"][:, 0] = _octahedral(mesh.normals)
    vertices["in_packed"][:, 1] = red | green << 8 | blue << 16 | material << 24
    vertices["in_packed"][:, 2] = tag | part << 8 | _SHADING_FLAG[mesh.material] << 16 | flags << 24
    return vertices


def _octahedral(normals: Float32Array) -> UInt32Array:
    """(V,) pairs of snorm16: (V, 3) unit normals folded onto a square (Cigolle et al. 2014)."""
    n = normals.T.astype(np.float64, order="C")  # rows are several times as fast as columns
    size = np.abs(n)
    n /= np.maximum(size[0] + size[1] + size[2], 1e-20)
    folded = (1.0 - np.abs(n[1::-1])) * np.where(n[:2] >= 0.0, 1.0, -1.0)
    square = np.where(n[2] >= 0.0, n[:2], folded)
    low, high = np.round(square * 32767.0).astype(np.int32).view(np.uint32) & np.uint32(0xFFFF)
    return low | high << np.uint32(16)
