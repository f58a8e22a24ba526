"""Ponds: water level with the lawn, in a rim of stone."""

import numpy as np
import shapely

from simbev_ros.assets.ground import LAND_HEIGHT_M
from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh import Mesh
from simbev_ros.assets.primitives import Finish, extrusion, plate
from simbev_ros.geometry.transforms import matrices_from_xyz_rpy
from simbev_ros.semantics import Tag
from simbev_ros.types import Float64Array

_WATER_RISE_M = 0.015
_WATER = Finish(Material.WATER, Tag.WATER, (46, 74, 78))
_RIM = Finish(Material.CONCRETE, Tag.STATIC, (142, 138, 130))


def pond(outline: shapely.Polygon) -> tuple[Mesh, Float64Array]:
    """A pond whose water fills an outline in the map frame, and its (4, 4) pose."""
    center = np.array(outline.centroid.coords[0])
    local = shapely.transform(outline, lambda xy: xy - center)
    rim = extrusion(_RIM, local.buffer(0.45, quad_segs=2).difference(local), -0.3, 0.16)
    pose = matrices_from_xyz_rpy(np.array([*center, LAND_HEIGHT_M]), np.zeros(3))
    return Mesh.merged([plate(_WATER, local, _WATER_RISE_M), rim]), pose
