"""Kalman filters with a constant-velocity model, state x, y, vx, vy, for all T tracked objects at once."""

import numpy as np

from simbev_ros.reference_stack.arrays import Floats


def predict(
    state: Floats, covariance: Floats, step_s: float, acceleration_mps2: float | Floats
) -> tuple[Floats, Floats]:
    """Predict (T, 4) states and (T, 4, 4) covariances ``step_s`` later.

    Accelerations are white noise with standard deviation ``acceleration_mps2``, one for all or (T,).
    """
    identity = np.eye(2)
    transition = np.block([[identity, step_s * identity], [0 * identity, identity]])
    of_acceleration = np.vstack([step_s**2 / 2 * identity, step_s * identity])
    gain = of_acceleration * np.asarray(acceleration_mps2)[..., None, None]
    noise = gain @ np.swapaxes(gain, -1, -2)
    return state @ transition.T, transition @ covariance @ transition.T + noise


def correct(state: Floats, covariance: Floats, measured: Floats, noise: Floats) -> tuple[Floats, Floats]:
    """Correct states and covariances with (T, M) measurements of the first M values, of (T, M, M) covariances."""
    count = measured.shape[1]
    gain = covariance[:, :, :count] @ np.linalg.inv(covariance[:, :count, :count] + noise)
    state = state + np.einsum("tij,tj->ti", gain, measured - state[:, :count])
    return state, covariance - gain @ covariance[:, :count, :]
