"""Kalman filters with a constant-velocity model, state x, y, vx, vy, for all T tracked objects at once."""

import numpy as np

from simbev_ros.reference_stack.arrays import Floats


def predict(state: Floats, covariance: Floats, step_s: float, acceleration_mps2: float) -> tuple[Floats, Floats]:
    """Predict (T, 4) states and (T, 4, 4) covariances ``step_s`` later.

    Accelerations are white noise with standard deviation ``acceleration_mps2``.
    """
    identity = np.eye(2)
    transition = np.block([[identity, step_s * identity], [0 * identity, identity]])
    gain = np.vstack([step_s**2 / 2 * identity, step_s * identity]) * acceleration_mps2
    return state @ transition.T, transition @ covariance @ transition.T + gain @ gain.T


def correct(state: Floats, covariance: Floats, position_m: Floats, noise_m2: Floats) -> tuple[Floats, Floats]:
    """Correct states and covariances with (T, 2) measured positions of (T, 2, 2) covariances."""
    gain = covariance[:, :, :2] @ np.linalg.inv(covariance[:, :2, :2] + noise_m2)
    state = state + np.einsum("tij,tj->ti", gain, position_m - state[:, :2])
    return state, covariance - gain @ covariance[:, :2, :]
