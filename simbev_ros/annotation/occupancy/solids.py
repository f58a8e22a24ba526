"""Which triangles of a mesh enclose something: its pieces, closed where little is missing.

Triangles with common edges make up a piece. A piece whose edges all have two sides is closed. Others lack a bit: hidden
faces of leaves within a crown or the ends of an abutment, which nobody sees, or needles that no float could hold. Caps
close them, if these are small next to the piece itself; what would need large ones (ground, paint, single leaves) is an
open sheet.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.types import BoolArray, Float32Array, Int32Array, Int64Array, UInt8Array

_MOST_CAP_SHARE = 0.5
"""Of the area of a piece: a tube twice as long as its radius has so much open at its ends, a flat sheet twice that."""


@dataclass(frozen=True, slots=True)
class Solids:
    """A mesh without what only concerns its looks; every corner that triangles share is one point.

    Attributes:
        points: (P, 3) float32, metres, in the mesh's frame; those of a part follow each other if the mesh's do.
        part: (P,) uint8 rigid part.
        tag: (P,) uint8 semantic tag.
        triangles: (T, 3) int32, caps last.
        is_solid: (T,) whether the triangle is of a closed piece.
    """

    points: Float32Array
    part: UInt8Array
    tag: UInt8Array
    triangles: Int32Array
    is_solid: BoolArray

    @classmethod
    def of(cls, mesh: Mesh) -> "Solids":
        """The pieces of a mesh."""
        first, triangles = _joined(mesh)
        points = mesh.vertices[first]
        piece, edges = _pieces(triangles)
        caps, cap_piece = _caps(edges)
        everything = np.concatenate([triangles, caps])
        owner = np.concatenate([piece, cap_piece])
        area = _areas(points, everything)
        own, missing = (
            np.bincount(owner, area),
            np.bincount(cap_piece, area[len(piece) :], int(piece.max(initial=-1)) + 1),
        )
        solid = missing < _MOST_CAP_SHARE * (own - missing)
        kept = np.append(np.ones(len(piece), bool), solid[cap_piece])
        return cls(points, mesh.part[first], mesh.tag[first], everything[kept], solid[owner][kept])


@dataclass(frozen=True, slots=True)
class _OpenEdges:
    """(K,) edges with more triangles on one side than on the other; from ``start`` to ``end`` as a cap needs it."""

    start: Int64Array
    end: Int64Array
    piece: Int64Array


def _joined(mesh: Mesh) -> tuple[Int64Array, Int32Array]:
    """(P,) a vertex for each place, part and tag that there is, in their order, and (T, 3) triangles between these."""
    place = np.zeros((len(mesh.vertices), 4), np.float32)
    place[:, :3] = mesh.vertices + np.float32(0.0)  # no negative zeros
    place[:, 3] = mesh.part.astype(np.float32) * 256.0 + mesh.tag
    rows = place.view(np.dtype((np.void, place.itemsize * 4))).reshape(-1)
    _, first, which = np.unique(rows, return_index=True, return_inverse=True)
    order = np.argsort(first)
    new = np.argsort(order).astype(np.int32)
    return first[order], new[which.reshape(-1)][mesh.triangles].reshape(-1, 3)


def _pieces(triangles: Int32Array) -> tuple[Int64Array, _OpenEdges]:
    """(T,) the piece of each triangle, counted from 0, and the edges that are open."""
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
    """(K, 3) triangles that close all borders, each a fan from one of its points, and (K,) the piece of each."""
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
    """(T,) areas, m²."""
    a, b, c = (points[triangles[:, corner]] for corner in range(3))
    areas: Float32Array = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2.0
    return areas
