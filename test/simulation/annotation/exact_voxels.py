"""Slow reference for voxelization: separating axes for surfaces, solid angles for solids."""

import numpy as np

from simbev_ros.foundation.types import BoolArray, Float64Array

_AXES = np.eye(3)


def touches(center: Float64Array, side: float, corners: Float64Array) -> BoolArray:
    """(T,) whether (T, 3, 3) triangles overlap a cube: none of the 13 axes separates them."""
    points = (np.asarray(corners, np.float64) - center) / side
    edges = np.roll(points, -1, axis=1) - points
    face = np.cross(edges[:, 0], edges[:, 1])[:, None]
    axes = np.concatenate(
        [np.broadcast_to(_AXES, (len(points), 3, 3)), face, np.cross(edges[:, :, None], _AXES).reshape(-1, 9, 3)],
        axis=1,
    )
    shadow = np.einsum("tai,tki->tak", axes, points)
    reach = np.abs(axes).sum(axis=2) / 2.0
    overlap: BoolArray = ((shadow.min(axis=2) <= reach) & (shadow.max(axis=2) >= -reach)).all(axis=1)
    return overlap


def winding_numbers(points: Float64Array, corners: Float64Array) -> Float64Array:
    """(N,) winding numbers of (T, 3, 3) triangles around (N, 3) points (van Oosterom and Strackee 1983)."""
    a, b, c = np.moveaxis(np.asarray(corners, np.float64)[None] - points[:, None, None], 2, 0)
    la, lb, lc = (np.linalg.norm(each, axis=-1) for each in (a, b, c))
    volume = np.einsum("nti,nti->nt", a, np.cross(b, c))
    dots = [np.einsum("nti,nti->nt", *pair) for pair in ((a, b), (b, c), (c, a))]
    spread = la * lb * lc + dots[0] * lc + dots[1] * la + dots[2] * lb
    winding: Float64Array = np.arctan2(volume, spread).sum(axis=1) / (2.0 * np.pi)
    return winding
