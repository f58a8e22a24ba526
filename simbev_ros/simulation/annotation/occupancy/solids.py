"""Splits a mesh into connected pieces and finds the ones that enclose a volume, closing small holes with caps.

A ``Mesh`` enters, ``Solids`` leave; occupancy voxelization fills the inside of solid pieces. Triangles with common
edges form a piece. A piece is closed if each of its edges has two sides. Others lack a few triangles: hidden faces of
leaves within a crown, the unseen ends of an abutment, or slivers too thin for float32. Caps close such holes if they
are small compared with the piece; a piece that would need large caps (ground, paint, single leaves) is an open sheet.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.foundation.types import BoolArray, Float32Array, Int32Array, Int64Array, UInt8Array

_MAX_CAP_SHARE = 0.5
"""Maximum area of the caps relative to the rest of a piece.

A tube twice as long as its radius lacks this share at its ends; a flat sheet lacks twice as much.
"""


@dataclass(frozen=True, slots=True)
class Solids:
    """A mesh without its appearance: vertices merged by position, and pieces closed with caps.

    Attributes:
        points: (P, 3) float32, meters, mesh frame; points of one part are contiguous if they are in the mesh.
        part: (P,) uint8 rigid part.
        tag: (P,) uint8 semantic tag.
        triangles: (T, 3) int32 indices of points, caps last.
        is_solid: (T,) whether the triangle belongs to a closed piece.
    """

    points: Float32Array
    part: UInt8Array
    tag: UInt8Array
    triangles: Int32Array
    is_solid: BoolArray

    @classmethod
    def from_mesh(cls, mesh: Mesh) -> "Solids":
        """Find the pieces of a mesh and close them where possible."""
        first, triangles = _merge_vertices(mesh)
        points = mesh.vertices[first]
        piece, edges = _pieces(triangles)
        caps, cap_piece = _caps(edges)
        all_triangles = np.concatenate([triangles, caps])
        owner = np.concatenate([piece, cap_piece])
        area = _areas(points, all_triangles)
        total_area, cap_area = (
            np.bincount(owner, area),
            np.bincount(cap_piece, area[len(piece) :], int(piece.max(initial=-1)) + 1),
        )
        is_solid = cap_area < _MAX_CAP_SHARE * (total_area - cap_area)
        kept = np.append(np.ones(len(piece), bool), is_solid[cap_piece])
        return cls(points, mesh.part[first], mesh.tag[first], all_triangles[kept], is_solid[owner][kept])


@dataclass(frozen=True, slots=True)
class _OpenEdges:
    """(K,) edges with more triangles on one side than on the other; a cap runs from ``start`` to ``end``."""

    start: Int64Array
    end: Int64Array
    piece: Int64Array


def _merge_vertices(mesh: Mesh) -> tuple[Int64Array, Int32Array]:
    """(P,) first vertex of each distinct position, part and tag, in mesh order, and (T, 3) triangles between these."""
    key = np.zeros((len(mesh.vertices), 4), np.float32)
    key[:, :3] = mesh.vertices + np.float32(0.0)  # no negative zeros
    key[:, 3] = mesh.part.astype(np.float32) * 256.0 + mesh.tag
    rows = key.view(np.dtype((np.void, key.itemsize * 4))).reshape(-1)
    _, first, vertex = np.unique(rows, return_index=True, return_inverse=True)
    order = np.argsort(first)
    new_index = np.argsort(order).astype(np.int32)
    return first[order], new_index[vertex.reshape(-1)][mesh.triangles].reshape(-1, 3)


def _pieces(triangles: Int32Array) -> tuple[Int64Array, _OpenEdges]:
    """(T,) piece index of each triangle, from 0, and the open edges."""
    start = triangles.reshape(-1).astype(np.int64)
    end = np.roll(triangles, -1, axis=1).reshape(-1).astype(np.int64)
    low, high = np.minimum(start, end), np.maximum(start, end)
    _, first, edge = np.unique(low << 32 | high, return_index=True, return_inverse=True)
    triangle = np.repeat(np.arange(len(triangles)), 3)
    size = len(triangles) + len(first)
    joins = coo_array((np.ones(len(edge), np.int8), (triangle, len(triangles) + edge)), shape=(size, size))
    _, label = connected_components(joins, directed=False)
    surplus = np.bincount(edge, np.sign(end - start), len(first)).astype(np.int64)
    times = np.abs(surplus)
    low, high = np.repeat(low[first], times), np.repeat(high[first], times)
    forward = np.repeat(surplus, times) > 0
    piece = label[: len(triangles)].astype(np.int64)
    open_piece = np.repeat(label[len(triangles) :], times).astype(np.int64)
    return piece, _OpenEdges(np.where(forward, high, low), np.where(forward, low, high), open_piece)


def _caps(edges: _OpenEdges) -> tuple[Int32Array, Int64Array]:
    """(K, 3) triangles that close all borders, each border by a fan from one of its points, and (K,) their piece."""
    count = len(edges.start)
    ends, index = np.unique(
        np.concatenate([edges.piece << 32 | edges.start, edges.piece << 32 | edges.end]), return_inverse=True
    )
    joins = coo_array((np.ones(count, np.int8), (index[:count], index[count:])), shape=(len(ends), len(ends)))
    _, border = connected_components(joins, directed=False)
    _, first = np.unique(border, return_index=True)
    apex = (ends & 0xFFFFFFFF)[first][border[index[:count]]]
    caps = np.stack([apex, edges.start, edges.end], axis=1).astype(np.int32)
    kept = (apex != edges.start) & (apex != edges.end)
    return caps[kept], edges.piece[kept]


def _areas(points: Float32Array, triangles: Int32Array) -> Float32Array:
    """(T,) triangle areas, m²."""
    a, b, c = (points[triangles[:, corner]] for corner in range(3))
    return (np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2.0).astype(np.float32, copy=False)
