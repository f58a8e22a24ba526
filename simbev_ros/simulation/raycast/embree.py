"""Interface to Embree through Open3D: a set of triangles is built once and then hit by any number of rays."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from simbev_ros.foundation.types import AnyArray, Float32Array, Float64Array, Int32Array, Int64Array
from simbev_ros.simulation.raycast.open3d_core import load_open3d_core

_OPEN3D = load_open3d_core()


@dataclass(frozen=True, slots=True)
class TriangleHits:
    """First hits of (N,) rays.

    Attributes:
        range_m: (N,) float32 range, inf where nothing was hit.
        triangle: (N,) int32 index of the triangle, -1 where nothing was hit.
        normal: (N, 3) float32 unit normal by the triangle's winding, zeros where nothing was hit.
        barycentric: (N, 2) float32 weights of the triangle's second and third corner.
    """

    range_m: Float32Array
    triangle: Int32Array
    normal: Float32Array
    barycentric: Float32Array


@dataclass(frozen=True, slots=True)
class Crossings:
    """All intersections of rays with triangles, in no particular order.

    Attributes:
        ray: (K,) int64 index of the ray.
        triangle: (K,) int64 index of the triangle.
        range_m: (K,) float32 range of the intersection.
    """

    ray: Int64Array
    triangle: Int64Array
    range_m: Float32Array


class TriangleSet:
    """Immutable bounding volume hierarchy of (T, 3) triangles over (V, 3) float32 vertices in meters."""

    def __init__(self, vertices_m: Float32Array, triangles: Int32Array) -> None:
        self._scene = _OPEN3D.t.geometry.RaycastingScene()
        self._is_empty = not len(triangles)
        if not self._is_empty:
            self._scene.add_triangles(_tensor(vertices_m), _tensor(triangles.astype(np.uint32)))

    def build(self) -> None:
        """Build the hierarchy now; otherwise the first cast does."""
        self.cast(np.array([[0.0, 0.0, 0.0, 0.0, 0.0, 1.0]], np.float32))

    def cast(self, rays: Float32Array) -> TriangleHits:
        """Find the first hits of (N, 6) float32 rays: origin in meters, unit direction."""
        found = self._scene.cast_rays(_tensor(rays))
        return TriangleHits(
            found["t_hit"].numpy(),
            found["primitive_ids"].numpy().view(np.int32),  # Embree's invalid id is all ones
            found["primitive_normals"].numpy(),
            found["primitive_uvs"].numpy(),
        )

    def crossings(self, rays: Float32Array) -> Crossings:
        """Find all intersections of (N, 6) float32 rays, as in ``cast``, with triangles, from either side."""
        if self._is_empty or not len(rays):
            return Crossings(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0, np.float32))
        found = self._scene.list_intersections(_tensor(rays))
        return Crossings(
            found["ray_ids"].numpy().astype(np.int64),
            found["primitive_ids"].numpy().astype(np.int64),
            found["t_hit"].numpy(),
        )


def relative_rays(origins_m: Float64Array, center_m: Float64Array, directions: Float32Array) -> Float32Array:
    """(N, 6) rays, relative to a (3,) center, from (N, 3) or (1, 3) origins and (N, 3) directions.

    They are written axis by axis, because NumPy copies rows of three values many times as slowly.
    """
    rays = np.empty((len(directions), 6), np.float32)
    for axis in range(3):
        rays[:, axis] = origins_m[:, axis] - center_m[axis]
        rays[:, 3 + axis] = directions[:, axis]
    return rays


def _tensor(array: AnyArray) -> Any:
    return _OPEN3D.core.Tensor.from_numpy(np.ascontiguousarray(array))
