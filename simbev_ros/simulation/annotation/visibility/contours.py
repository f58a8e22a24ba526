"""Contours of posed meshes as a camera sees them: the edges where the faces turned to the camera end.

Mesh instances with poses in the optical frame enter, contour segments leave, from which ``silhouettes`` counts pixels.
An edge shared by two triangles that both face the camera cancels out. The remaining edges run around the silhouette,
and around parts of it that are in front of others, always with the inside on the same side. Contours therefore hold all
information about a silhouette in a sixth of the edges. Back faces are not drawn (actors are closed), nor is anything
nearer than the near plane; contours follow the cuts along that plane.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from simbev_ros.foundation.geometry.transforms import inverse
from simbev_ros.foundation.types import BoolArray, Float64Array, Int64Array
from simbev_ros.simulation.annotation.visibility.shells import Shell


class MeshInstances(NamedTuple):
    """Objects that share a mesh.

    Attributes:
        shell: The shell of the mesh.
        slot: (K,) index of each object.
        optical_from_rest: (K, P, 4, 4) pose of each of their parts in the camera's optical frame.
    """

    shell: Shell
    slot: Int64Array
    optical_from_rest: Float64Array


class Contours(NamedTuple):
    """Contour segments in no particular order; the segments of an object form closed loops with bit-equal ends.

    Attributes:
        slot: (M,) index of the object.
        sign: (M,) 1 if the object is on the left of the segment as the camera sees it, -1 if it is on the right.
        ends: (2, 2, M) float64 positions on the plane z = 1 of the optical frame: x and y, of start and end.
    """

    slot: Int64Array
    sign: Int64Array
    ends: Float64Array


class Outlines(NamedTuple):
    """Contours as ``Contours`` has them, but in all directions, and not clipped at any depth.

    Attributes:
        slot: (M,) index of the object.
        sign: (M,) see ``Contours``.
        ends_m: (3, 2, M) float64 positions in the optical frame: x, y and z, of start and end.
        behind: (K,) index of the object of each of its surfaces that is right behind the camera and turned to it.
    """

    slot: Int64Array
    sign: Int64Array
    ends_m: Float64Array
    behind: Int64Array


class _Primitives(NamedTuple):
    """Edges (C = 2) or triangles (C = 3) of posed objects in the rest pose, by corner.

    Attributes:
        slot: (M,) index of the object.
        sign: (M,) see ``Contours``.
        pose: (M,) index of their pose.
        rest_m: (3, C, M) their corners in the rest pose.
    """

    slot: Int64Array
    sign: Int64Array
    pose: Int64Array
    rest_m: Float64Array


class _Corners(NamedTuple):
    """Edges or triangles of posed objects in the optical frame, (3, C, M) corners."""

    slot: Int64Array
    sign: Int64Array
    corners_m: Float64Array


def trace_contours(objects: Sequence[MeshInstances], near_m: float) -> Contours:
    """Contours of one or more groups of instances, clipped at the positive depth ``near_m``."""
    edges, triangles = _trace(
        objects, lambda each: each.optical_from_rest[:, :, 2, 3].min(axis=1) - each.shell.reach_m < near_m
    )
    corner_parts = [_clip_edges(edges, near_m)]
    if triangles is not None:
        corner_parts.append(_near_plane_cuts(triangles, near_m))
    slot, sign, ends_m = (np.concatenate(arrays, axis=-1) for arrays in zip(*corner_parts, strict=True))
    return Contours(slot, sign, ends_m[:2] / ends_m[2])


def trace_outlines(objects: Sequence[MeshInstances]) -> Outlines:
    """Outlines of one or more groups of instances."""
    edges, triangles = _trace(objects, _may_be_behind)
    behind = np.zeros(0, np.int64) if triangles is None else triangles.slot[_on_axis_behind(triangles.corners_m)]
    return Outlines(edges.slot, edges.sign, edges.corners_m, behind)


def _may_be_behind(instances: MeshInstances) -> BoolArray:
    """(K,) whether objects may lie on the optical axis behind the camera."""
    x_m, y_m, z_m = np.moveaxis(instances.optical_from_rest[:, :, :3, 3], 2, 0)
    reach_m = instances.shell.reach_m
    return ((np.hypot(x_m, y_m) < reach_m) & (z_m < reach_m)).any(axis=1)


def _on_axis_behind(corners_m: Float64Array) -> BoolArray:
    """(M,) whether (3, 3, M) triangles cross the optical axis behind the camera."""
    (x, y, z), next_corner = corners_m, [1, 2, 0]
    turn = x * y[next_corner] - x[next_corner] * y  # of each side around the axis
    is_around = (turn > 0.0).all(axis=0) | (turn < 0.0).all(axis=0)
    return is_around & ((turn[next_corner] * z).sum(axis=0) / np.where(is_around, turn.sum(axis=0), 1.0) < 0.0)


def _trace(
    objects: Sequence[MeshInstances], needs_triangles: Callable[[MeshInstances], BoolArray]
) -> tuple[_Corners, _Corners | None]:
    """Contour edges of all instances, and the triangles that face the camera of those instances that need them."""
    edge_parts, near_triangles, first = [], [], 0
    for instances in objects:
        count, parts = instances.optical_from_rest.shape[:2]
        eyes_m = np.ones((count, parts, 4), np.float32)
        eyes_m[..., :3] = inverse(instances.optical_from_rest)[..., :3, 3]
        front, pose = instances.shell.front_faces(eyes_m), first + parts * np.arange(count)
        edge_parts.append(_contour_edges(instances, front, pose))
        if len(near := np.flatnonzero(needs_triangles(instances))):
            near_triangles.append(_front_triangles(instances, front, pose, near))
        first += parts * count
    poses = np.concatenate([instances.optical_from_rest[:, :, :3].reshape(-1, 12) for instances in objects]).T
    triangles = _pose_primitives(poses, near_triangles) if near_triangles else None
    return _pose_primitives(poses, edge_parts), triangles


def _contour_edges(objects: MeshInstances, front: BoolArray, pose: Int64Array) -> _Primitives:
    """The edges between faces that are turned to the camera and faces that are not."""
    shell = objects.shell
    inside = front.take(shell.left, axis=1)
    flat_index = np.flatnonzero(inside != front.take(shell.right, axis=1))
    index, edge = np.divmod(flat_index, len(shell.edges))
    sign = np.where(inside.ravel()[flat_index], 1, -1)
    return _primitives(objects, index, shell.edges.take(edge, axis=0), sign, pose)


def _front_triangles(objects: MeshInstances, front: BoolArray, pose: Int64Array, near: Int64Array) -> _Primitives:
    """The triangles of the objects ``near`` that face the camera."""
    row, triangle = np.nonzero(front[near, :-1])
    return _primitives(objects, near[row], objects.shell.triangles[triangle], np.ones(len(row), np.int64), pose)


def _primitives(
    objects: MeshInstances, index: Int64Array, vertices: Int64Array, sign: Int64Array, pose: Int64Array
) -> _Primitives:
    """Edges or triangles with (M, C) vertices, of the objects with (M,) given indices."""
    shell = objects.shell
    rest_m = shell.vertices_m.take(vertices.T, axis=1)
    return _Primitives(objects.slot[index], sign, pose[index] + shell.part[vertices[:, 0]], rest_m)


def _pose_primitives(poses: Float64Array, primitives: Sequence[_Primitives]) -> _Corners:
    """Transform primitives to the optical frame with (12, R) poses.

    Avoids matrix products, because their last bits can depend on the position in the array.
    """
    slot, sign, pose, (x, y, z) = (np.concatenate(arrays, axis=-1) for arrays in zip(*primitives, strict=True))
    corners_m = np.empty((3, *x.shape))
    for row, coordinate in enumerate(corners_m):
        a, b, c, d = poses[4 * row : 4 * row + 4].take(pose, axis=1)
        np.multiply(a, x, out=coordinate)
        coordinate += b * y
        coordinate += c * z
        coordinate += d
    return _Corners(slot, sign, corners_m)


def _clip_edges(edges: _Corners, near_m: float) -> _Corners:
    """The edges, or the parts of edges, that are not nearer than a depth."""
    start, end = edges.corners_m[:, 0], edges.corners_m[:, 1]
    start_ahead, end_ahead = edges.corners_m[2] >= near_m
    leaving, entering = np.flatnonzero(start_ahead & ~end_ahead), np.flatnonzero(end_ahead & ~start_ahead)
    end[:, leaving] = _near_plane_point(end[:, leaving], start[:, leaving], near_m)
    start[:, entering] = _near_plane_point(start[:, entering], end[:, entering], near_m)
    kept = start_ahead | end_ahead
    return _Corners(edges.slot[kept], edges.sign[kept], edges.corners_m[:, :, kept])


def _near_plane_cuts(triangles: _Corners, near_m: float) -> _Corners:
    """Cuts of triangles at a depth, from where their border leaves the visible side to where it returns."""
    ahead = triangles.corners_m[2] >= near_m
    mixed = np.flatnonzero(ahead.any(axis=0) & ~ahead.all(axis=0))
    corners_m, ahead, column = triangles.corners_m[:, :, mixed], ahead[:, mixed], np.arange(len(mixed))
    next_ahead = np.roll(ahead, -1, axis=0)
    cuts = np.empty((3, 2, len(mixed)))
    for row, leaves in enumerate((ahead & ~next_ahead, ~ahead & next_ahead)):
        side = leaves.argmax(axis=0)
        start, end = corners_m[:, side, column], corners_m[:, (side + 1) % 3, column]
        cuts[:, row] = _near_plane_point(end, start, near_m) if row == 0 else _near_plane_point(start, end, near_m)
    return _Corners(triangles.slot[mixed], triangles.sign[mixed], cuts)


def _near_plane_point(behind_m: Float64Array, ahead_m: Float64Array, near_m: float) -> Float64Array:
    """(3, M) points at depth ``near_m`` between (3, M) points in front of it and (3, M) points beyond it."""
    share = (near_m - behind_m[2]) / (ahead_m[2] - behind_m[2])
    cut: Float64Array = behind_m + share * (ahead_m - behind_m)
    cut[2] = near_m
    return cut
