"""Fits a rectangle to each cluster: the heading at which its points lie closest to two edges, like the letter L.

Source: Zhang et al., Efficient L-Shape Fitting for Vehicle Detection Using Laser Scanners, IV 2017 (closeness).
"""

from dataclasses import dataclass

import numpy as np

from simbev_ros.reference_stack.arrays import Floats, Integers, box_axes
from simbev_ros.reference_stack.clusters import Clusters

_HEADINGS_RAD = np.radians(np.arange(0.0, 90.0, 3.0))
_MIN_EDGE_DISTANCE_M = 0.1
"""Distances from an edge below this one count equally, because lidars are noisy."""
_TOP_QUANTILE = 0.97
"""Height quantile taken as the top of a cluster; the few points above it are rain or leaves."""


@dataclass(frozen=True)
class Rectangles:
    """The visible extents of C clusters, ego frame.

    Attributes:
        center_m: (C, 2) center of the rectangle around the points.
        yaw_rad: (C,) direction of its first side, 0 … π/2.
        side_m: (C, 2) lengths of its first and second side.
        top_m: (C,) height of the top above the ground.
        ground_m: (C,) z of the ground below the cluster.
        points: (C,) number of points.
    """

    center_m: Floats
    yaw_rad: Floats
    side_m: Floats
    top_m: Floats
    ground_m: Floats
    points: Integers


def fit_rectangles(clusters: Clusters) -> Rectangles:
    """Fit a rectangle around each cluster."""
    first = np.flatnonzero(np.diff(clusters.cluster, prepend=-1))
    count = np.diff(first, append=len(clusters.cluster))
    if not len(first):
        empty = np.zeros(0)
        return Rectangles(np.zeros((0, 2)), empty, np.zeros((0, 2)), empty, empty, count)
    axes = box_axes(_HEADINGS_RAD)
    # float32: arrays of headings × sides × points are the largest of all
    x, y = clusters.points_m[:, :2].T.astype(np.float32)
    along = axes[..., :1].astype(np.float32) * x + axes[..., 1:].astype(np.float32) * y
    low, high = np.minimum.reduceat(along, first, axis=2), np.maximum.reduceat(along, first, axis=2)
    to_edge = np.minimum(along - low[..., clusters.cluster], high[..., clusters.cluster] - along).min(axis=1)
    closeness = np.add.reduceat(1.0 / np.maximum(to_edge, _MIN_EDGE_DISTANCE_M), first, axis=1)
    rising_m = clusters.height_m[np.lexsort((clusters.height_m, clusters.cluster))]
    best, each = closeness.argmax(axis=0), np.arange(len(first))
    low_m, high_m = low[best, :, each].astype(np.float64), high[best, :, each].astype(np.float64)
    return Rectangles(
        center_m=np.einsum("cs,csi->ci", (low_m + high_m) / 2, axes[best]),
        yaw_rad=_HEADINGS_RAD[best],
        side_m=high_m - low_m,
        top_m=rising_m[first + np.ceil(_TOP_QUANTILE * (count - 1)).astype(np.int64)],
        ground_m=np.add.reduceat(clusters.points_m[:, 2] - clusters.height_m, first) / count,
        points=count,
    )
