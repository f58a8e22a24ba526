import numpy as np
import pytest
from pydantic import TypeAdapter, ValidationError

from simbev_ros.config.draw import Distribution, Drawn, sample


@pytest.mark.parametrize(
    ("distribution", "mean", "sigma"),
    [
        (Distribution(uniform=(2, 6)), 4, 4 / 12**0.5),
        (Distribution(integer=(0, 3)), 1.5, (15 / 12) ** 0.5),
        (Distribution(beta=(0.8, 1.0), scale=100), 100 * 0.8 / 1.8, 100 * (0.8 / (1.8**2 * 2.8)) ** 0.5),
        (Distribution(normal=(3.2, 1.0), offset=-1), 2.2, 1.0),
        (Distribution(lognormal=(0.16, 0.64)), np.exp(0.16 + 0.64**2 / 2), None),
        (Distribution(choice=[1, 1, 4]), 2, 2**0.5),
    ],
)
def test_draws_have_the_textbook_moments(distribution: Distribution, mean: float, sigma: float | None) -> None:
    rng = np.random.default_rng(1)
    draws = np.array([distribution.sample(rng) for _ in range(20_000)])
    assert draws.mean() == pytest.approx(mean, abs=0.03 * (sigma or mean))
    if sigma is not None:
        assert draws.std() == pytest.approx(sigma, rel=0.03)
    low, high = distribution.support
    assert low <= draws.min() <= draws.max() <= high


def test_clipping_bounds_draws_and_support() -> None:
    distribution = Distribution(normal=(0, 5), min=-1, max=2)
    rng = np.random.default_rng(1)
    draws = [distribution.sample(rng) for _ in range(100)]
    assert distribution.support == (-1, 2)
    assert (min(draws), max(draws)) == (-1, 2)


def test_a_negative_scale_reverses_the_support() -> None:
    assert Distribution(uniform=(1, 2), scale=-3).support == (-6, -3)


def test_a_number_is_returned_unchanged() -> None:
    assert sample(TypeAdapter(Drawn).validate_python(4), np.random.default_rng(0)) == 4.0


@pytest.mark.parametrize("bad", [{"uniform": [3, 1]}, {"beta": [0, 1]}, {"normal": [0, -1]}, {"choice": []}, {}])
def test_impossible_distributions_are_refused(bad: dict[str, object]) -> None:
    with pytest.raises(ValidationError):
        Distribution.model_validate(bad)
