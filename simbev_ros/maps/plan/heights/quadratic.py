"""Sparse quadratic programmes with soft limits, by a primal-dual interior-point method (Mehrotra, 1992)."""

import numpy as np
from scipy.sparse import csc_array, csr_array, diags_array, vstack
from scipy.sparse.linalg import splu

from simbev_ros.types import Float64Array

_STIFFNESS = 1e7  # of the limits: what cannot be kept gives way a little, everywhere a bit
_MOST_STEPS = 60
_ACCURACY = 1e-4
_TO_THE_WALL = 0.995


def solve(
    quadratic: csc_array, linear: Float64Array, rows: csr_array, low: Float64Array, high: Float64Array
) -> Float64Array:
    """The minimiser of ``x P x / 2 - q x`` within ``low <= A x <= high``, or nearly within where there is none.

    Args:
        quadratic: (U, U) P, positive definite.
        linear: (U,) q.
        rows: (C, U) A, its rows scaled so that a violation by 0.01 is a small one.
        low: (C,) smallest values, -inf for none.
        high: (C,) largest values, inf for none.

    Returns:
        (U,) x.
    """
    below, above = np.isfinite(low), np.isfinite(high)
    limits = csr_array(vstack([rows[above], -rows[below]]))
    bound = np.concatenate([high[above], -low[below]])
    x: Float64Array = splu(quadratic).solve(linear)
    if len(bound) == 0 or np.all(limits @ x <= bound):
        return x
    slack = np.maximum(bound - limits @ x, 1.0)
    force = np.ones(len(bound))
    for _ in range(_MOST_STEPS):
        pull = quadratic @ x - linear + limits.T @ force
        miss = limits @ x + slack - force / _STIFFNESS - bound
        gap = float(slack @ force) / len(bound)
        if max(gap, np.max(np.abs(pull)), np.max(np.abs(miss))) < _ACCURACY:
            break
        give = slack / force + 1.0 / _STIFFNESS
        matrix = csc_array(quadratic + limits.T @ diags_array(1.0 / give) @ limits)
        factor = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})

        def direction(product: Float64Array) -> tuple[Float64Array, Float64Array, Float64Array]:
            """Newton's step towards products of slack and force that are smaller by ``product``."""
            pushed = (miss - product / force) / give  # noqa: B023
            dx = factor.solve(-pull - limits.T @ pushed)  # noqa: B023
            dforce = pushed + (limits @ dx) / give  # noqa: B023
            return dx, -(product + slack * dforce) / force, dforce  # noqa: B023

        _, dslack, dforce = direction(slack * force)
        reach = _reach(slack, dslack, force, dforce)
        left = float((slack + reach * dslack) @ (force + reach * dforce)) / len(bound)
        center = gap * (left / gap) ** 3
        dx, dslack, dforce = direction(slack * force + dslack * dforce - center)
        reach = _TO_THE_WALL * _reach(slack, dslack, force, dforce)
        x, slack, force = x + reach * dx, slack + reach * dslack, force + reach * dforce
    return x


def _reach(slack: Float64Array, dslack: Float64Array, force: Float64Array, dforce: Float64Array) -> float:
    """The longest step, at most 1, that keeps slacks and forces positive."""
    value, change = np.concatenate([slack, force]), np.concatenate([dslack, dforce])
    falling = change < 0.0
    return float(min(1.0, np.min(-value[falling] / change[falling], initial=1.0)))
