"""Signs of quaternions in exports: q and -q are the same rotation, but readers interpolate and subtract them."""

import numpy as np
from numpy.typing import ArrayLike

from simbev_ros.foundation.geometry.transforms import with_signs_of
from simbev_ros.foundation.types import Float64Array


def positive(wxyz: Float64Array) -> Float64Array:
    """(4,) the same rotation with w >= 0, for poses that do not change."""
    return np.asarray(-wxyz if wxyz[0] < 0.0 else wxyz, np.float64)


def continuous(wxyz: ArrayLike) -> Float64Array:
    """(N, 4) the same rotations in order of time, each with the sign that is nearer to the one before; first w >= 0."""
    return with_signs_of(np.asarray(wxyz, np.float64).reshape(-1, 4), np.array([1.0, 0.0, 0.0, 0.0]))
