"""Mehrotra's predictor-corrector interior-point method for sparse convex quadratic programs with soft constraints.

In: the matrices of a convex quadratic program. Out: its minimizer. Notation as in Nocedal & Wright, Numerical
Optimization (2006), section 16.6, with slack variables y and dual variables lambda; predictor and corrector as in
Mehrotra, On the Implementation of a Primal-Dual Interior Point Method (1992). With all bounds written as ``C x <= d``,
the program is

    min  x P x / 2 - q x + rho |v|^2 / 2   subject to   C x + y - v = d,  y >= 0,

with constraint violation v, which its optimality condition v = lambda / rho eliminates. The remaining optimality (KKT)
conditions are

    P x - q + C^T lambda = 0,   C x + y - lambda / rho - d = 0,   y_i lambda_i = 0,   y, lambda >= 0.
"""

import numpy as np
from scipy.sparse import csc_array, csr_array, diags_array, vstack
from scipy.sparse.linalg import splu

from simbev_ros.foundation.types import Float64Array

_PENALTY = 1e7  # rho, weight of squared violations; infeasible limits are spread over all conflicting rows
_MAX_ITERATIONS = 60
_TOLERANCE = 1e-4  # for the duality measure and the largest dual and primal residual
_FRACTION_TO_BOUNDARY = 0.995  # of the step at which the first slack or dual variable becomes zero


def solve_qp(
    quadratic: csc_array, linear: Float64Array, rows: csr_array, low: Float64Array, high: Float64Array
) -> Float64Array:
    """Minimize ``x P x / 2 - q x`` subject to the soft constraints ``low <= A x <= high``.

    Infeasible constraints are violated slightly. If the unconstrained minimizer satisfies all constraints, it is
    returned.

    Args:
        quadratic: (U, U) P, positive definite.
        linear: (U,) q.
        rows: (C, U) A, its rows scaled so that a violation by 0.01 is small.
        low: (C,) lower bounds, -inf for none.
        high: (C,) upper bounds, inf for none.

    Returns:
        (U,) x, after at most 60 iterations.
    """
    below, above = np.isfinite(low), np.isfinite(high)
    constraints = csr_array(vstack([rows[above], -rows[below]]))
    upper = np.concatenate([high[above], -low[below]])
    x: Float64Array = splu(quadratic).solve(linear)
    if len(upper) == 0 or np.all(constraints @ x <= upper):
        return x
    slack = np.maximum(upper - constraints @ x, 1.0)
    dual = np.ones(len(upper))
    for _ in range(_MAX_ITERATIONS):
        dual_residual = quadratic @ x - linear + constraints.T @ dual
        primal_residual = constraints @ x + slack - dual / _PENALTY - upper
        mu = float(slack @ dual) / len(upper)  # duality measure
        if max(mu, np.max(np.abs(dual_residual)), np.max(np.abs(primal_residual))) < _TOLERANCE:
            break
        # Eliminating dy and dlambda leaves (P + C^T D^-1 C) dx, with D = Y / Lambda + I / rho.
        scaling = slack / dual + 1.0 / _PENALTY
        reduced_matrix = csc_array(quadratic + constraints.T @ diags_array(1.0 / scaling) @ constraints)
        factor = splu(
            reduced_matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
        )

        def newton_direction(complementarity_residual: Float64Array) -> tuple[Float64Array, Float64Array, Float64Array]:
            """Newton direction (dx, dy, dlambda) for the residual r of ``y_i lambda_i``, by the normal equations."""
            ddual_const = (primal_residual - complementarity_residual / dual) / scaling  # noqa: B023
            dx = factor.solve(-dual_residual - constraints.T @ ddual_const)  # noqa: B023
            ddual = ddual_const + (constraints @ dx) / scaling  # noqa: B023
            return dx, -(complementarity_residual + slack * ddual) / dual, ddual  # noqa: B023

        # Predictor (affine scaling) direction, and Mehrotra's centering parameter (mu_affine / mu)^3.
        _, dslack, ddual = newton_direction(slack * dual)
        step_length = _max_step_length(slack, dslack, dual, ddual)
        mu_affine = float((slack + step_length * dslack) @ (dual + step_length * ddual)) / len(upper)
        target_mu = mu * (mu_affine / mu) ** 3
        # Corrector: second-order term of the predictor, and centering towards the target duality measure.
        dx, dslack, ddual = newton_direction(slack * dual + dslack * ddual - target_mu)
        step_length = _FRACTION_TO_BOUNDARY * _max_step_length(slack, dslack, dual, ddual)
        x, slack, dual = x + step_length * dx, slack + step_length * dslack, dual + step_length * ddual
    return x


def _max_step_length(slack: Float64Array, dslack: Float64Array, dual: Float64Array, ddual: Float64Array) -> float:
    """The longest step, at most 1, that keeps slack and dual variables nonnegative (ratio test)."""
    variables, steps = np.concatenate([slack, dual]), np.concatenate([dslack, ddual])
    decreasing = steps < 0.0
    return float(min(1.0, np.min(-variables[decreasing] / steps[decreasing], initial=1.0)))
