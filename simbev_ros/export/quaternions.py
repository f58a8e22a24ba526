"""Signs of quaternions in exports: q and -q are the same rotation, but readers interpolate and subtract them."""

import numpy as np
from numpy.typing import ArrayLike

from simbev_ros.foundation.types import Float64Array


def positive(wxyz: Float64Array) -> Float64Array:
    """(4,) the same rotation with w >= 0, for poses that do not change."""
    return np.asarray(-wxyz if wxyz[0] < 0.0 else wxyz, np.float64)


def continuous(wxyz: ArrayLike) -> Float64Array:
    """(N, 4) the same rotations in order of time, each with the sign that is nearer to the one before; first w >= 0."""
    quaternions = np.asarray(wxyz, np.float64).reshape(-1, 4)
    flips = np.where(np.einsum("ni,ni->n", quaternions[1:], quaternions[:-1]) < 0.0, -1.0, 1.0)
    first = np.where(quaternions[:1, 0] < 0.0, -1.0, 1.0)
    return quaternions * np.cumprod(np.concatenate([first, flips]))[:, None] + 0.0
