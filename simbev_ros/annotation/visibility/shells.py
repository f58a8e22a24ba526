"""Meshes prepared for finding their contours: which triangles meet at which edges."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.types import BoolArray, Float32Array, Float64Array, Int64Array


@dataclass(frozen=True, slots=True)
class Shell:
    """A mesh in its rest pose.

    Every edge is there once: on its left, seen from outside, is the triangle that goes along it, on its right the one
    that goes back. Where none goes back, ``right`` is one more than the last triangle.

    Attributes:
        vertices_m: (3, V) actor frame.
        part: (V,) rigid part that moves each.
        reach_m: Distance of the farthest vertex from the origin.
        triangles: (T, 3) vertices, counter-clockwise seen from outside, ascending part.
        planes: (T, 4) outward normal n and offset d: n · x + d is positive on the outside, 0 on the plane.
        parts: Part and range of its triangles.
        edges: (E, 2) vertices.
        left: (E,) triangles.
        right: (E,) triangles.
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
    def of(cls, mesh: Mesh) -> "Shell":
        """The shell of a mesh, of whose parts each has its own triangles."""
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
        return cls(vertices_m, part, reach_m, triangles, planes, parts, *_edges(triangles, _welded(mesh)))

    def faces(self, eyes_m: Float32Array) -> BoolArray:
        """(K, T + 1) which triangles turn their outside to eyes; of what is beside an edge without neighbour, none.

        Args:
            eyes_m: (K, P, 4) homogeneous places of K eyes, in the rest frame of each part.
        """
        height_m = np.zeros((len(eyes_m), len(self.planes) + 1), np.float32)
        for part, run in self.parts:
            np.matmul(eyes_m[:, part], self.planes[run].T, out=height_m[:, run])
        return height_m > 0.0


def _welded(mesh: Mesh) -> Int64Array:
    """(V,) number of the place of each vertex; vertices of one part at the same place have the same."""
    keys = (*mesh.vertices.T, mesh.part)
    order = np.lexsort(keys)
    is_new = np.zeros(len(order), bool)
    for key in keys:
        is_new[1:] |= np.diff(key[order]) != 0
    welded = np.empty(len(order), np.int64)
    welded[order] = np.cumsum(is_new)
    return welded


def _edges(triangles: Int64Array, welded: Int64Array) -> tuple[Int64Array, Int64Array, Int64Array]:
    """``Shell.edges``, ``left`` and ``right``: sides of triangles that go along the same edge to and fro are paired."""
    sides = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=-1).reshape(-1, 2)
    triangle = np.repeat(np.arange(len(triangles)), 3)
    start, end = welded[sides].T
    forward = (start < end).astype(np.int64)
    edge = np.minimum(start, end) * (welded.max(initial=0) + 1) + np.maximum(start, end)
    turn = _turn(2 * edge + forward)
    order = np.lexsort((forward, turn, edge))
    sides, triangle = sides[order], triangle[order]
    paired = np.flatnonzero((np.diff(edge[order]) == 0) & (np.diff(turn[order]) == 0))
    right = np.full(len(order), len(triangles))
    right[paired] = triangle[paired + 1]
    is_edge = start[order] != end[order]
    is_edge[paired + 1] = False
    return sides[is_edge], triangle[is_edge], right[is_edge]


def _turn(keys: Int64Array) -> Int64Array:
    """(N,) how many earlier elements have the same key."""
    order = np.argsort(keys, kind="stable")
    is_first = np.diff(keys[order], prepend=-1) != 0
    place = np.arange(len(keys))
    turn = np.empty(len(keys), np.int64)
    turn[order] = place - np.maximum.accumulate(np.where(is_first, place, 0))
    return turn
