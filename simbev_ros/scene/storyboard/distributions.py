"""Expands files of parameter values (OpenSCENARIO XML 1.1 and later) into the variations of a scenario."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path

import numpy as np

from simbev_ros.config.map_files import expand_home
from simbev_ros.foundation.errors import InputError, foreign_content
from simbev_ros.scene.storyboard.model import Element
from simbev_ros.scene.storyboard.parameters import Value
from simbev_ros.scene.storyboard.problems import Problems
from simbev_ros.scene.storyboard.reading import read_element
from simbev_ros.scene.storyboard.resolving import Resolver, parse_scenario

MAX_VARIATIONS = 10_000
"""Variations of a file, and values of a parameter in one."""

_MAX_VALUES = 1_000_000
_MAX_TRIES = 1_000


@dataclass(frozen=True, slots=True)
class Variation:
    """One variation of a scenario.

    Attributes:
        path: The scenario's file.
        values: Values of its parameters for ``resolve``.
    """

    path: Path
    values: Mapping[str, Value] = field(default_factory=dict)


def variations(path: Path, rng: np.random.Generator) -> list[Variation]:
    """The variations that a file of parameter values asks for, or the one of a scenario's file, without values.

    Deterministic distributions are combined, the last one fastest; stochastic ones give as many variations as the
    file says.

    Args:
        path: The file.
        rng: Source of the values of stochastic distributions, unless the file has a seed.

    Raises:
        InputError: The file cannot be read, is not valid, or has more than ``MAX_VARIATIONS`` variations.
    """
    problems = Problems()
    with foreign_content(path):
        source = parse_scenario(path).find("ParameterValueDistribution")
        if source is None:
            return [Variation(path)]
        distribution = read_element(
            Resolver(path, {}, problems).resolved(source, {}, path, 1), "ParameterValueDistribution", problems
        )
        problems.raise_any()
        scenario = path.parent / expand_home(distribution.scenario_file.filepath)
        part = distribution.distribution
        rows = _combinations(part) if part.kind == "Deterministic" else _draws(part, rng)
        return [Variation(scenario, row) for row in rows]


def _combinations(deterministic: Element) -> list[dict[str, Value]]:
    """Values of the parameters in every combination."""
    choices = [_choices(part) for part in deterministic.parts]
    _check_count(deterministic, math.prod(map(len, choices)), len(choices))
    return [{name: value for choice in row for name, value in choice.items()} for row in product(*choices)]


def _choices(part: Element) -> Sequence[Mapping[str, Value]]:
    """The values of one parameter, or sets of values of several ones."""
    if part.kind == "DeterministicMultiParameterDistribution":
        return [{item.parameter_ref: item.value for item in row.assignments} for row in part.sets]
    if part.values.kind == "DistributionSet":
        return [{part.parameter_name: item.value} for item in part.values.elements]
    low, high, step = part.values.range.lower_limit, part.values.range.upper_limit, part.values.step_width
    if not (step > 0 and low <= high):
        raise InputError(
            f"{part.values.origin}: must have a stepWidth above 0 and an upperLimit that is not below lowerLimit"
        )
    count = math.floor(min((high - low) / step, MAX_VARIATIONS) + _STEP_TOLERANCE) + 1
    _check_count(part, count, 1)
    return [{part.parameter_name: round(low + step * index, _DECIMALS)} for index in range(count)]


_STEP_TOLERANCE = 1e-9
_DECIMALS = 12


def _check_count(element: Element, count: int, parameters: int) -> None:
    if count > MAX_VARIATIONS or count * parameters > _MAX_VALUES:
        raise InputError(f"{element.origin}: gives more than {MAX_VARIATIONS:,} variations")


def _draws(stochastic: Element, rng: np.random.Generator) -> list[dict[str, Value]]:
    """Random values of the parameters, of as many variations as the file says."""
    _check_count(stochastic, stochastic.number_of_test_runs, len(stochastic.distributions))
    if stochastic.number_of_test_runs == 0:
        raise InputError(f"{stochastic.origin}: numberOfTestRuns is '0'; must be at least 1")
    if stochastic.random_seed is not None:
        rng = np.random.default_rng(abs(int(stochastic.random_seed)))
    return [
        {part.parameter_name: _draw(part.law, rng) for part in stochastic.distributions}
        for _ in range(stochastic.number_of_test_runs)
    ]


def _draw(law: Element, rng: np.random.Generator) -> Value:
    """A random value; of laws with a range, one inside."""
    if law.kind in ("Histogram", "ProbabilityDistributionSet"):
        parts = law.bins if law.kind == "Histogram" else law.elements
        weights = np.array([part.weight for part in parts])
        if not 0 < weights.sum() < math.inf:
            raise InputError(f"{law.origin}: the sum of the weights must be above 0")
        part = parts[rng.choice(len(parts), p=weights / weights.sum())]
        return _uniform(part, rng) if law.kind == "Histogram" else part.value
    if law.kind == "UniformDistribution":
        return _uniform(law, rng)
    for _ in range(_MAX_TRIES):
        value = float(_LAWS[law.kind](law, rng))
        if law.range is None or law.range.lower_limit <= value <= law.range.upper_limit:
            return value
    raise InputError(f"{law.origin}: no value of {_MAX_TRIES:,} lies in the range")


def _uniform(element: Element, rng: np.random.Generator) -> float:
    low, high = element.range.lower_limit, element.range.upper_limit
    if low > high:
        raise InputError(f"{element.range.origin}: lowerLimit is above upperLimit")
    return float(rng.uniform(low, high))


def _log_normal(law: Element, rng: np.random.Generator) -> float:
    """A value whose own expectation and variance, not those of its logarithm, are the law's."""
    if law.expected_value == 0:
        raise InputError(f"{law.origin}: expectedValue must be above 0")
    variance = math.log1p(law.variance / law.expected_value**2)
    return rng.lognormal(math.log(law.expected_value) - variance / 2, math.sqrt(variance))


_LAWS: Mapping[str, Callable[[Element, np.random.Generator], float]] = {
    "NormalDistribution": lambda law, rng: rng.normal(law.expected_value, math.sqrt(law.variance)),
    "LogNormalDistribution": _log_normal,
    "PoissonDistribution": lambda law, rng: rng.poisson(law.expected_value),
}
