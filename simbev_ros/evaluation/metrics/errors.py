"""Errors of matched predictions in position, orientation, size and velocity."""

import numpy as np

from simbev_ros.evaluation.metrics.boxes import Boxes
from simbev_ros.evaluation.metrics.overlap import aligned_iou
from simbev_ros.foundation.types import Float64Array

ERRORS: tuple[str, ...] = ("ATE", "AOE", "ASE", "AVE")
"""Errors of translation (m), orientation (rad), scale (1 - IoU of the sizes alone) and velocity (m/s)."""


def errors_of(truth: Boxes, predicted: Boxes, planar: bool) -> Float64Array:
    """Errors of matched boxes, row by row.

    Args:
        truth: (K,) ground-truth boxes.
        predicted: (K,) predicted boxes.
        planar: Whether translation and velocity ignore z.

    Returns:
        (K, 4) in the order of ``ERRORS``; NaN: unknown velocity.
    """
    turn_rad = angle_between_rad(truth.yaw_rad, predicted.yaw_rad)
    scale = 1.0 - aligned_iou(truth.size_m, predicted.size_m)
    velocity = distance(truth.velocity_mps, predicted.velocity_mps, planar)
    return np.stack([distance(truth.center_m, predicted.center_m, planar), turn_rad, scale, velocity], axis=1)


def distance(values: Float64Array, others: Float64Array, planar: bool) -> Float64Array:
    """(K,) Euclidean distance between (K, 3) vectors, in x and y only if ``planar``."""
    difference = (others - values)[:, : 2 if planar else 3]
    return np.sqrt(np.einsum("ki,ki->k", difference, difference))


def angle_between_rad(yaw_rad: Float64Array, other_rad: Float64Array, period_rad: float = 2.0 * np.pi) -> Float64Array:
    """(K,) smallest difference between yaws, from 0 to half the period."""
    half_rad = period_rad / 2.0
    return np.abs((yaw_rad - other_rad + half_rad) % period_rad - half_rad)
