"""Orientations of an IMU with the errors of an attitude and heading reference: they fit their covariance."""

from functools import cache

import numpy as np
import pytest
from analytic_motion import CAR
from scipy.spatial.transform import Rotation
from scipy.stats import chi2
from synthetic_world import TICK_NS, actor, world

from simbev_ros.config.positioning import Imu
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.simulation.sensors.imu import ImuModel, ImuSamples

EXACT = dict.fromkeys(("tilt_drift_sigma_deg", "heading_drift_sigma_deg", "noise_sigma_deg"), 0.0)
TRUE = Rotation.from_euler("xyz", [0.02, -0.05, 2.0])


@cache
def standing(tick: int) -> WorldState:
    roll, pitch, yaw = TRUE.as_euler("xyz").tolist()
    return world(actor(CAR, roll=roll, pitch=pitch, yaw=yaw), tick=tick)


def measure(seed: int, ticks: int = 1, samples: int = 1, **orientation: float) -> list[ImuSamples]:
    """Samples of an ego at rest on a slope, with a mounted IMU that is turned left."""
    imu = Imu.model_validate({"type": "imu", "name": "imu", "pose": {"yaw_deg": 90}, "orientation": orientation or {}})
    model = ImuModel(imu, seed, TICK_NS, samples=samples)
    return [model.measure(standing(tick), None) for tick in range(ticks)]


def errors_rad(*measured: ImuSamples) -> np.ndarray:
    """(S, 3) rotations about the axes of the map from the true to the measured orientation, of all samples."""
    orientations = Rotation.from_quat(np.concatenate([samples.orientation_xyzw for samples in measured]))
    return (orientations * (TRUE * Rotation.from_euler("z", np.pi / 2)).inv()).as_rotvec()


def test_orientation_errors_are_off_by_default() -> None:
    imu = Imu.model_validate({"type": "imu", "name": "imu"})
    assert imu.orientation is None
    samples = ImuModel(imu, 1, TICK_NS).measure(world(actor(CAR)), None)
    assert np.array_equal(samples.orientation_covariance, np.eye(3) * 1e-12)


def test_without_errors_the_orientation_is_that_of_the_sensor() -> None:
    (samples,) = measure(1, **EXACT)
    assert np.abs(errors_rad(samples)).max() < 1e-6
    assert np.diag(samples.orientation_covariance).tolist() == [1e-12] * 3


def test_the_covariance_fits_the_error_over_many_seeds() -> None:
    """The normalized error squared has 3 degrees of freedom."""
    seeds = 300
    squares = []
    for seed in range(seeds):
        (samples,) = measure(seed)
        (error,) = errors_rad(samples)
        squares.append(error @ np.linalg.solve(samples.orientation_covariance, error))
    low, high = chi2.ppf([0.0005, 0.9995], 3 * seeds) / seeds
    assert low < np.mean(squares) < high


@pytest.mark.slow
def test_tilt_is_small_and_forgets_within_its_time_and_the_heading_drifts_slowly() -> None:
    """Autocorrelation of a Gauss-Markov process after its time: 1/e."""
    runs = np.array([errors_rad(*measure(seed, 41, tilt_drift_time_s=1.0, noise_sigma_deg=0.0)) for seed in range(40)])
    first, later = runs[:, 20], runs[:, 40]
    tilt = np.corrcoef(first[:, :2].ravel(), later[:, :2].ravel())[0, 1]
    assert tilt == pytest.approx(np.exp(-1), abs=0.15)
    assert np.corrcoef(first[:, 2], later[:, 2])[0, 1] > 0.98
    assert np.degrees(runs[:, :, :2].std()) == pytest.approx(0.3, rel=0.1)


def test_a_fast_imu_has_an_error_for_each_sample() -> None:
    first, second = measure(3, 2, samples=10)
    assert (len(errors_rad(first)), len(errors_rad(second))) == (1, 10)
    assert len(np.unique(errors_rad(second)[:, 0])) == 10


def test_the_heading_drifts_by_the_same_amount_at_any_rate() -> None:
    slow, fast = (
        np.std([errors_rad(measure(seed, 3, samples, noise_sigma_deg=0.0)[-1])[-1, 2] for seed in range(100)])
        for samples in (1, 5)
    )
    assert slow == pytest.approx(np.radians(1.5), rel=0.15) and fast == pytest.approx(np.radians(1.5), rel=0.15)
