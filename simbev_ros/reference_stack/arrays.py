"""Array types and small geometry functions that the whole stack uses; docstrings state shape, unit and frame."""

from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Booleans = npt.NDArray[np.bool_]
Bytes = npt.NDArray[np.uint8]
Table: TypeAlias = Any
"""A structured array; its dtype is documented where it is defined. An array's type takes mypy 7 s more."""


def rotate(rotation: Floats, vectors: Floats) -> Floats:
    """Rotate (…, D) vectors by a (D, D) matrix, without the threads of BLAS, which would occupy more cores."""
    product: Floats = np.einsum("ij,...j->...i", rotation, vectors)
    return product


def yaw_of(pose: Floats) -> float:
    """Heading of a (4, 4) pose, rad."""
    return float(np.arctan2(pose[1, 0], pose[0, 0]))


def box_axes(yaw_rad: Floats) -> Floats:
    """(…, 2, 2) forward and left axes of boxes with (…) headings; ``axes @ offset`` is the offset in the box's axes."""
    cosine, sine = np.cos(yaw_rad), np.sin(yaw_rad)
    return np.stack([np.stack([cosine, sine], axis=-1), np.stack([-sine, cosine], axis=-1)], axis=-2)
