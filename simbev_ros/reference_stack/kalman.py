"""Kalman filters of objects that move on with constant velocity: state x, y, vx, vy; all T of them at once."""

import numpy as np

from simbev_ros.reference_stack.arrays import Floats


def predict(state: Floats, covariance: Floats, step_s: float, acceleration_mps2: float) -> tuple[Floats, Floats]:
    """(T, 4) states and (T, 4, 4) covariances a while later; accelerations are noise of a standard deviation."""
    identity = np.eye(2)
    transition = np.block([[identity, step_s * identity], [0 * identity, identity]])
    gain = np.vstack([step_s**2 / 2 * identity, step_s * identity]) * acceleration_mps2
    return state @ transition.T, transition @ covariance @ transition.T + gain @ gain.T


def correct(state: Floats, covariance: Floats, place_m: Floats, noise_m2: Floats) -> tuple[Floats, Floats]:
    """The same after (T, 2) places have been measured with (T, 2, 2) covariances."""
    gain = covariance[:, :, :2] @ np.linalg.inv(covariance[:, :2, :2] + noise_m2)
    state = state + np.einsum("tij,tj->ti", gain, place_m - state[:, :2])
    return state, covariance - gain @ covariance[:, :2, :]
