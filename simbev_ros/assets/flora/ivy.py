"""Ivy on walls: leaves over a patch of an upright face of a mesh, around the windows in it."""

import numpy as np

from simbev_ros.assets.flora.crowns import foliage, sprig_directions
from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.palette import pick_color

_CLIMBED = (Material.FACADE, Material.BRICK_FACADE, Material.TIMBER_FACADE, Material.BRICK, Material.WOOD)
_WITH_WINDOWS = (Material.FACADE, Material.BRICK_FACADE, Material.TIMBER_FACADE)
_BAY_M = 3.0
_LEAF_M, _OFF_WALL_M, _BELOW = 0.26, 0.06, 0.35


def ivy(rng: np.random.Generator, host: Mesh, count: int) -> Mesh:
    """Build up to ``count`` sprigs of ivy that climb from the foot of one face of a mesh; none if it has no wall."""
    corners = host.vertices[host.triangles].astype(np.float64)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(normals, axis=1)
    normals /= np.maximum(area, 1e-9)[:, None]
    wall = np.isin(host.material[host.triangles[:, 0]], _CLIMBED) & (np.abs(normals[:, 2]) < 0.05)
    area = np.where(wall, area, 0.0)
    if area.sum() < 1.0:
        return Mesh.empty()
    face = int(rng.choice(len(area), p=area / area.sum()))
    along, out = np.cross([0.0, 0.0, 1.0], normals[face]), normals[face]
    area = np.where((normals @ out > 0.99) & (np.abs((corners[:, 0] - corners[face, 0]) @ out) < 0.4), area, 0.0)
    chosen = rng.choice(len(area), 3 * count, p=area / area.sum())
    weight = rng.dirichlet((1.0, 1.0, 1.0), len(chosen))[..., None]
    points_m = (corners[chosen] * weight).sum(axis=1)
    off_m = points_m @ along - rng.choice(points_m @ along)
    top_m = rng.uniform(2.5, 7.0) * (1.0 - (off_m / rng.uniform(1.8, 4.5)) ** 2) + 0.5 * np.sin(2.7 * off_m)
    place = np.mod((host.uv[host.triangles[chosen]] * weight).sum(axis=1), _BAY_M)
    glazed = np.isin(host.material[host.triangles[chosen, 0]], _WITH_WINDOWS)
    glazed &= ((place > [0.75, 0.75]) & (place < [2.25, 2.5])).all(axis=1)
    points_m = points_m[(points_m[:, 2] > 0.0) & (points_m[:, 2] < top_m) & ~glazed][:count]
    outward = np.broadcast_to(out, points_m.shape)
    hanging = sprig_directions(rng, outward, 0.1, -0.6)
    middle_m = corners[face, 0] - 6.0 * out
    below = rng.random(len(points_m)) < _BELOW  # large, dark leaves close to the wall
    length_m, tone = np.where(below, 2.2, 1.0) * _LEAF_M, np.where(below, 0.75, 1.0)
    points_m = points_m + np.where(below, 0.5, 1.0)[:, None] * _OFF_WALL_M * out
    return foliage(rng, points_m, outward, hanging, middle_m, length_m, pick_color(rng, "ivy", 0.12), tone)
