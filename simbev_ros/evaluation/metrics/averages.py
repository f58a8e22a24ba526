"""Averages of metrics, some of which may be undefined."""

import numpy as np

from simbev_ros.foundation.types import AnyArray, Float64Array


def mean_ignoring_nan(values: Float64Array, axis: int | None = None) -> AnyArray:
    """Mean of the values that are not NaN, along an axis or over all; NaN if there are none."""
    known = ~np.isnan(values)
    count = known.sum(axis=axis)
    total = np.where(known, values, 0.0).sum(axis=axis)
    return np.divide(total, count, out=np.full(np.shape(total), np.nan), where=count > 0)
