"""Contours of posed meshes as a camera sees them: the edges where what faces the camera ends.

Of a triangle that faces the camera, every edge that it shares with another such triangle cancels out. What is left runs
around the silhouette, and around parts of it before others, always with the inside on the same hand. So contours hold
all that is to be known of a silhouette, in a sixth of the edges. Triangles that turn away are not drawn (actors are
closed), and nothing is that is nearer than the near plane; contours run along the cuts.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from simbev_ros.annotation.visibility.shells import Shell
from simbev_ros.geometry.transforms import inverse
from simbev_ros.types import BoolArray, Float64Array, Int64Array


class Likeness(NamedTuple):
    """Objects that share a mesh.

    Attributes:
        shell: Of the mesh.
        slot: (K,) number of each object.
        optical_from_rest: (K, P, 4, 4) pose of each of their parts in the camera's optical frame.
    """

    shell: Shell
    slot: Int64Array
    optical_from_rest: Float64Array


class Contours(NamedTuple):
    """Segments in no particular order; those of an object form closed loops, with bit-equal ends.

    Attributes:
        slot: (M,) number of the object.
        sign: (M,) 1 if the object is on the left of the segment as the camera sees it, -1 if it is on the right.
        ends: (2, 2, M) float64 places on the plane z = 1 of the optical frame: x and y, of start and end.
    """

    slot: Int64Array
    sign: Int64Array
    ends: Float64Array


class _Chosen(NamedTuple):
    """Edges (C = 2) or triangles (C = 3) of posed objects, by corner.

    Attributes:
        slot: (M,) number of the object.
        sign: (M,) as of contours.
        pose: (M,) which pose they have.
        rest_m: (3, C, M) their corners in the rest pose.
    """

    slot: Int64Array
    sign: Int64Array
    pose: Int64Array
    rest_m: Float64Array


class _Corners(NamedTuple):
    """The same in the optical frame."""

    slot: Int64Array
    sign: Int64Array
    corners_m: Float64Array


def contours(objects: Sequence[Likeness], near_m: float) -> Contours:
    """The contours of at least one kind of objects, clipped at a depth that is positive."""
    edges, near_triangles, first = [], [], 0
    for each in objects:
        count, parts = each.optical_from_rest.shape[:2]
        eyes_m = np.ones((count, parts, 4), np.float32)
        eyes_m[..., :3] = inverse(each.optical_from_rest)[..., :3, 3]
        front, pose = each.shell.faces(eyes_m), first + parts * np.arange(count)
        edges.append(_edges(each, front, pose))
        near = np.flatnonzero(each.optical_from_rest[:, :, 2, 3].min(axis=1) - each.shell.reach_m < near_m)
        if len(near):
            near_triangles.append(_triangles(each, front, pose, near))
        first += parts * count
    poses = np.concatenate([each.optical_from_rest[:, :, :3].reshape(-1, 12) for each in objects]).T
    parts_of = [_clipped(_posed(poses, edges), near_m)]
    if near_triangles:
        parts_of.append(_cuts(_posed(poses, near_triangles), near_m))
    slot, sign, ends_m = (np.concatenate(each, axis=-1) for each in zip(*parts_of, strict=True))
    return Contours(slot, sign, ends_m[:2] / ends_m[2])


def _edges(objects: Likeness, front: BoolArray, pose: Int64Array) -> _Chosen:
    """The edges at which what faces the camera ends."""
    shell = objects.shell
    inside = front.take(shell.left, axis=1)
    found = np.flatnonzero(inside != front.take(shell.right, axis=1))
    index, edge = np.divmod(found, len(shell.edges))
    sign = np.where(inside.ravel()[found], 1, -1)
    return _chosen(objects, index, shell.edges.take(edge, axis=0), sign, pose)


def _triangles(objects: Likeness, front: BoolArray, pose: Int64Array, near: Int64Array) -> _Chosen:
    """The triangles of some objects that face the camera."""
    row, triangle = np.nonzero(front[near, :-1])
    return _chosen(objects, near[row], objects.shell.triangles[triangle], np.ones(len(row), np.int64), pose)


def _chosen(objects: Likeness, index: Int64Array, vertices: Int64Array, sign: Int64Array, pose: Int64Array) -> _Chosen:
    """Of (M,) objects the edges or triangles with (M, C) vertices."""
    shell = objects.shell
    rest_m = shell.vertices_m.take(vertices.T, axis=1)
    return _Chosen(objects.slot[index], sign, pose[index] + shell.part[vertices[:, 0]], rest_m)


def _posed(poses: Float64Array, chosen: Sequence[_Chosen]) -> _Corners:
    """Everything chosen, where (12, R) poses put it.

    Without matrix products and the like, whose last bits can depend on the place in the array.
    """
    slot, sign, pose, (x, y, z) = (np.concatenate(each, axis=-1) for each in zip(*chosen, strict=True))
    corners_m = np.empty((3, *x.shape))
    for row, place in enumerate(corners_m):
        a, b, c, d = poses[4 * row : 4 * row + 4].take(pose, axis=1)
        np.multiply(a, x, out=place)
        place += b * y
        place += c * z
        place += d
    return _Corners(slot, sign, corners_m)


def _clipped(edges: _Corners, near_m: float) -> _Corners:
    """Those of the edges, or of their parts, that are not nearer than a depth."""
    start, end = edges.corners_m[:, 0], edges.corners_m[:, 1]
    start_ahead, end_ahead = edges.corners_m[2] >= near_m
    leaving, entering = np.flatnonzero(start_ahead & ~end_ahead), np.flatnonzero(end_ahead & ~start_ahead)
    end[:, leaving] = _cut(end[:, leaving], start[:, leaving], near_m)
    start[:, entering] = _cut(start[:, entering], end[:, entering], near_m)
    kept = start_ahead | end_ahead
    return _Corners(edges.slot[kept], edges.sign[kept], edges.corners_m[:, :, kept])


def _cuts(triangles: _Corners, near_m: float) -> _Corners:
    """Where triangles are cut at a depth: from where their border leaves what is beyond to where it comes back."""
    ahead = triangles.corners_m[2] >= near_m
    mixed = np.flatnonzero(ahead.any(axis=0) & ~ahead.all(axis=0))
    corners_m, ahead, every = triangles.corners_m[:, :, mixed], ahead[:, mixed], np.arange(len(mixed))
    onward = np.roll(ahead, -1, axis=0)
    cuts = np.empty((3, 2, len(mixed)))
    for place, leaves in enumerate((ahead & ~onward, ~ahead & onward)):
        side = leaves.argmax(axis=0)
        one, other = corners_m[:, side, every], corners_m[:, (side + 1) % 3, every]
        cuts[:, place] = _cut(other, one, near_m) if place == 0 else _cut(one, other, near_m)
    return _Corners(triangles.slot[mixed], triangles.sign[mixed], cuts)


def _cut(behind_m: Float64Array, ahead_m: Float64Array, near_m: float) -> Float64Array:
    """(3, M) points of a depth between (3, M) points before and beyond it."""
    share = (near_m - behind_m[2]) / (ahead_m[2] - behind_m[2])
    cut: Float64Array = behind_m + share * (ahead_m - behind_m)
    cut[2] = near_m
    return cut
