"""Finds obstacles for pedestrians on sidewalks (trunks, poles, benches) among all objects of a region."""

from collections.abc import Sequence

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.foundation.types import Float64Array, Table

OBSTACLE_DTYPE = np.dtype(
    [
        ("x", "<f8"),  # m, map frame: center of a disc at the foot
        ("y", "<f8"),
        ("z", "<f8"),
        ("radius", "<f8"),  # m
        ("away_x", "<f8"),  # unit vector away from the carriageway: the side on which pedestrians pass
        ("away_y", "<f8"),
    ]
)

_ANKLE_M, _KNEE_M = 0.12, 0.6
_MAX_WIDTH_M = 1.2  # wider objects block a sidewalk instead of standing on it
_MAX_DISCS = 5


def obstacles_on(
    sidewalk: BaseGeometry, road: BaseGeometry, placed_objects: Sequence[tuple[Mesh, Float64Array]]
) -> Table:
    """Discs around all objects on sidewalks.

    Args:
        sidewalk: Area of the sidewalks in plan, map frame.
        road: Area of the carriageways.
        placed_objects: Upright meshes, and the (N, 4, 4) poses of their copies, map frame.

    Returns:
        (K,) ``OBSTACLE_DTYPE``; long objects are covered by several discs.
    """
    shapely.prepare(sidewalk)
    discs = [np.empty((0, 4))]
    for mesh, poses in placed_objects:
        here = poses[shapely.contains_xy(sidewalk, poses[:, :2, 3])]
        if len(here):
            own = _discs(mesh)
            middle_m = np.einsum("nij,kj->nki", here[:, :3, :3], own[:, :3]) + here[:, None, :3, 3]
            radius_m = own[:, 3] * np.linalg.norm(here[:, :3, 0], axis=1)[:, None]
            discs.append(np.concatenate([middle_m, radius_m[..., None]], axis=2).reshape(-1, 4))
    every = np.concatenate(discs)
    result = np.zeros(len(every), OBSTACLE_DTYPE)
    if len(every) and not road.is_empty:
        shortest_m = shapely.get_coordinates(shapely.shortest_line(road, shapely.points(every[:, :2]))).reshape(
            -1, 2, 2
        )
        away_m = shortest_m[:, 1] - shortest_m[:, 0]
        result["away_x"], result["away_y"] = (away_m / np.maximum(np.hypot(*away_m.T), 1e-9)[:, None]).T
    result["x"], result["y"], result["z"], result["radius"] = every.T
    return result


def obstacle_corners_m(mesh: Mesh, above_m: float = 0.0) -> Float64Array:
    """(N, 3) corners of triangles that pedestrians run into, mesh frame, of an upright mesh ``above_m`` the ground."""
    corner_m = mesh.vertices[mesh.triangles].astype(np.float64)
    low_m, high_m = corner_m[..., 2].min(axis=1), corner_m[..., 2].max(axis=1)
    return corner_m[(low_m < _KNEE_M - above_m) & (high_m > _ANKLE_M - above_m)].reshape(-1, 3)


def _discs(mesh: Mesh) -> Float64Array:
    """(K, 4) centers and radii of discs around the obstacle corners of a mesh; none if the mesh is too wide."""
    corners_m = obstacle_corners_m(mesh)
    if not len(corners_m):
        return np.empty((0, 4))
    low, high = corners_m[:, :2].min(axis=0), corners_m[:, :2].max(axis=0)
    size_m = high - low
    along = int(size_m[1] > size_m[0])
    if size_m.min() > _MAX_WIDTH_M:
        return np.empty((0, 4))
    half_width_m, length_m = max(float(size_m.min()) / 2.0, 0.03), float(size_m.max())
    count = min(max(1, round(length_m / (2.0 * half_width_m))), _MAX_DISCS)
    discs = np.zeros((count, 4))
    discs[:, :2] = (low + high) / 2.0
    discs[:, along] = low[along] + size_m[along] * (np.arange(count) + 0.5) / count
    discs[:, 3] = max(half_width_m, length_m / count / 2.0)
    return discs
