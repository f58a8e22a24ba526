"""Points of clouds, and distances to triangles by Ericson, "Real-Time Collision Detection", section 5.1.5."""

import numpy as np

from simbev_ros.foundation.types import Float64Array, Table


def xyz(cloud: Table) -> Float64Array:
    """(N, 3) positions of a cloud's points, in its frame."""
    return np.column_stack([cloud["x"], cloud["y"], cloud["z"]]).astype(np.float64)


def distances_m(points: Float64Array, corners: Float64Array, within_m: float = 0.02) -> Float64Array:
    """(N,) distances of (N, 3) points from the nearest of (T, 3, 3) triangles; inf if none is within ``within_m``."""
    low, high = corners.min(axis=1) - within_m, corners.max(axis=1) + within_m
    nearest2 = np.full(len(points), np.inf)
    for k, point in enumerate(points):
        near = np.flatnonzero(((low <= point) & (point <= high)).all(axis=1))
        if len(near):
            nearest2[k] = _squares(point, *np.moveaxis(corners[near], 1, 0)).min()
    return np.sqrt(nearest2)


def _squares(p: Float64Array, a: Float64Array, b: Float64Array, c: Float64Array) -> Float64Array:
    """(T,) squared distances of a point from triangles."""
    ab, ac, ap = b - a, c - a, p - a
    dot = np.einsum
    normal = np.cross(ab, ac)
    area2 = dot("ti,ti->t", normal, normal)
    with np.errstate(divide="ignore", invalid="ignore"):
        v = dot("ti,ti->t", np.cross(ap, ac), normal) / area2
        w = dot("ti,ti->t", np.cross(ab, ap), normal) / area2
        plane2 = dot("ti,ti->t", ap, normal) ** 2 / area2
    inside = (area2 > 0) & (v >= 0) & (w >= 0) & (v + w <= 1)
    edges2 = np.min([_segment(p, a, ab), _segment(p, a, ac), _segment(p, b, c - b)], axis=0)
    return np.where(inside, plane2, edges2)


def _segment(p: Float64Array, start: Float64Array, along: Float64Array) -> Float64Array:
    """(T,) squared distances of a point from segments."""
    length2 = np.maximum(np.einsum("ti,ti->t", along, along), 1e-300)
    share = np.clip(np.einsum("ti,ti->t", p - start, along) / length2, 0.0, 1.0)
    gap = p - start - share[:, None] * along
    return np.einsum("ti,ti->t", gap, gap)
