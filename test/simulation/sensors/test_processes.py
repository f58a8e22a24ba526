"""The statistics of the sensors' error processes agree with closed forms."""

import math

import numpy as np
import pytest

from simbev_ros.simulation.sensors.processes import Drift, Outages


def rng(seed: int = 3) -> np.random.Generator:
    return np.random.default_rng(seed)


def test_a_gauss_markov_error_keeps_its_sigma_and_decorrelates_with_its_time_constant() -> None:
    sigma = np.array([2.0, 2.0, 5.0])
    values = Drift.gauss_markov(rng(), sigma, time_s=2.0, step_s=0.05).values_until(60_000, count=60_000)
    assert values.std(axis=0) == pytest.approx(sigma, rel=0.06)
    for apart, correlation in ((40, math.exp(-1.0)), (20, math.exp(-0.5))):  # 2 s and 1 s
        alike = np.mean(values[apart:] * values[:-apart], axis=0) / values.var(axis=0)
        assert alike == pytest.approx([correlation] * 3, abs=0.05)
    starts = [Drift.gauss_markov(rng(seed), sigma, 2.0, 0.05).values_until(0)[0] for seed in range(400)]
    assert np.std(starts, axis=0) == pytest.approx(sigma, rel=0.12)


@pytest.mark.parametrize("step_s", [0.05, 0.01])
def test_a_random_walk_begins_at_zero_and_grows_with_the_square_root_of_time(step_s: float) -> None:
    walks = [Drift.random_walk(rng(seed), 0.3, step_s) for seed in range(200)]
    assert not any(walk.values_until(0).any() for walk in walks)
    for time_s in (1.0, 4.0):
        ends = [walk.values_until(round(time_s / step_s)) for walk in walks]
        assert np.std(ends) == pytest.approx(0.3 * math.sqrt(time_s), rel=0.12)


def test_values_do_not_depend_on_which_steps_were_asked_for() -> None:
    one, other = (Drift.random_walk(rng(), 1.0, 0.01) for _ in range(2))
    whole = np.concatenate([one.values_until(0), one.values_until(40, count=40)])
    assert np.array_equal(other.values_until(3), whole[3:4])
    assert np.array_equal(other.values_until(10, count=4), whole[7:11])
    assert np.array_equal(other.values_until(40, count=30), whole[11:])
    some, every = Outages(rng(), 0.4, 0.3, 0.05), Outages(rng(), 0.4, 0.3, 0.05)
    assert [every.is_off(index) for index in range(200)][::7] == [some.is_off(index) for index in range(0, 200, 7)]


@pytest.mark.parametrize("step_s", [0.05, 0.2])
def test_outages_have_the_configured_share_and_mean_duration(step_s: float) -> None:
    outages = Outages(rng(), share=0.2, mean_s=3.0, step_s=step_s)
    off = np.array([outages.is_off(index) for index in range(round(20_000 / step_s))])
    assert off.mean() == pytest.approx(0.2, abs=0.02)
    begins = np.count_nonzero(np.diff(off.astype(int)) == 1)
    assert off.sum() / begins * step_s == pytest.approx(3.0, rel=0.1)


def test_an_outage_share_of_zero_gives_no_outages() -> None:
    outages = Outages(rng(), share=0.0, mean_s=5.0, step_s=0.05)
    assert not any(outages.is_off(index) for index in range(1000))
