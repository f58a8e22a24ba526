"""Meshes prepared for contour extraction: which triangles meet at which edges."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.foundation.types import BoolArray, Float32Array, Float64Array, Int64Array


@dataclass(frozen=True, slots=True)
class Shell:
    """A mesh in its rest pose, with edge adjacency.

    Every edge is listed once: seen from outside, the triangle on its left runs along it, and the triangle on its right
    runs against it. Where no triangle runs against it, ``right`` is one more than the last triangle index.

    Attributes:
        vertices_m: (3, V) actor frame.
        part: (V,) rigid part that moves each vertex.
        reach_m: Maximum distance of a vertex from the origin.
        triangles: (T, 3) vertex indices, counter-clockwise seen from outside, ascending part.
        planes: (T, 4) outward normal n and offset d: n · x + d is positive on the outside, 0 on the plane.
        parts: Index of each part and the slice of its triangles.
        edges: (E, 2) vertex indices.
        left: (E,) triangle indices.
        right: (E,) triangle indices.
    """

    vertices_m: Float64Array
    part: Int64Array
    reach_m: float
    triangles: Int64Array
    planes: Float32Array
    parts: tuple[tuple[int, slice], ...]
    edges: Int64Array
    left: Int64Array
    right: Int64Array

    @classmethod
    def from_mesh(cls, mesh: Mesh) -> "Shell":
        """Build the shell of a mesh; no triangle may span several rigid parts."""
        owner = mesh.part[mesh.triangles[:, 0]]
        order = np.argsort(owner, kind="stable")
        triangles, owner = mesh.triangles[order].astype(np.int64), owner[order]
        vertices_m = mesh.vertices.astype(np.float64)
        corners_m = vertices_m[triangles]
        normal = np.cross(corners_m[:, 1] - corners_m[:, 0], corners_m[:, 2] - corners_m[:, 0])
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
        offset = -np.einsum("ti,ti->t", normal, corners_m[:, 0])
        borders = [0, *(np.flatnonzero(np.diff(owner)) + 1).tolist(), len(owner)]
        parts = tuple((int(owner[start]), slice(start, end)) for start, end in pairwise(borders) if end > start)
        planes = np.column_stack([normal, offset]).astype(np.float32)
        reach_m = float(np.linalg.norm(vertices_m, axis=1).max())
        vertices_m, part = np.ascontiguousarray(vertices_m.T), mesh.part.astype(np.int64)
        return cls(vertices_m, part, reach_m, triangles, planes, parts, *_edges(triangles, _weld_vertices(mesh)))

    def front_faces(self, eyes_m: Float32Array) -> BoolArray:
        """(K, T + 1) whether triangles face the eye positions; the last column, for edges without a neighbor, is False.

        Args:
            eyes_m: (K, P, 4) homogeneous positions of K eyes, in the rest frame of each part.
        """
        height_m = np.zeros((len(eyes_m), len(self.planes) + 1), np.float32)
        for part, triangle_slice in self.parts:
            np.matmul(eyes_m[:, part], self.planes[triangle_slice].T, out=height_m[:, triangle_slice])
        return height_m > 0.0


def _weld_vertices(mesh: Mesh) -> Int64Array:
    """(V,) position index of each vertex; vertices of one part at the same position share it."""
    keys = (*mesh.vertices.T, mesh.part)
    order = np.lexsort(keys)
    is_new = np.zeros(len(order), bool)
    for key in keys:
        is_new[1:] |= np.diff(key[order]) != 0
    position_id = np.empty(len(order), np.int64)
    position_id[order] = np.cumsum(is_new)
    return position_id


def _edges(triangles: Int64Array, position_id: Int64Array) -> tuple[Int64Array, Int64Array, Int64Array]:
    """``Shell.edges``, ``left`` and ``right``: pairs triangle sides that run along an edge in opposite directions."""
    sides = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=-1).reshape(-1, 2)
    triangle = np.repeat(np.arange(len(triangles)), 3)
    start, end = position_id[sides].T
    forward = (start < end).astype(np.int64)
    edge = np.minimum(start, end) * (position_id.max(initial=0) + 1) + np.maximum(start, end)
    occurrence = _occurrence(2 * edge + forward)
    order = np.lexsort((forward, occurrence, edge))
    sides, triangle = sides[order], triangle[order]
    paired = np.flatnonzero((np.diff(edge[order]) == 0) & (np.diff(occurrence[order]) == 0))
    right = np.full(len(order), len(triangles))
    right[paired] = triangle[paired + 1]
    is_edge = start[order] != end[order]
    is_edge[paired + 1] = False
    return sides[is_edge], triangle[is_edge], right[is_edge]


def _occurrence(keys: Int64Array) -> Int64Array:
    """(N,) number of earlier elements with the same key."""
    order = np.argsort(keys, kind="stable")
    is_first = np.diff(keys[order], prepend=-1) != 0
    index = np.arange(len(keys))
    occurrence = np.empty(len(keys), np.int64)
    occurrence[order] = index - np.maximum.accumulate(np.where(is_first, index, 0))
    return occurrence
