"""Files of parameter values give the variations that they say, and random values of the distribution that they name."""

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hand_written_scenario import write_hand_written_scenario

from simbev_ros.foundation.errors import InputError
from simbev_ros.scene.storyboard.distributions import MAX_VARIATIONS, Variation, variations
from simbev_ros.scene.storyboard.reading import resolve

HEAD = '<FileHeader revMajor="1" revMinor="3" date="2026-01-01T00:00:00" description="" author=""/>'
SET = """<DeterministicSingleParameterDistribution parameterName="owner">
  <DistributionSet><Element value="ego"/><Element value="other"/></DistributionSet>
</DeterministicSingleParameterDistribution>"""
PAIRS = """<DeterministicMultiParameterDistribution><ValueSetDistribution>
  <ParameterValueSet>
    <ParameterAssignment parameterRef="speed" value="1"/><ParameterAssignment parameterRef="runs" value="2"/>
  </ParameterValueSet>
  <ParameterValueSet>
    <ParameterAssignment parameterRef="speed" value="3"/><ParameterAssignment parameterRef="runs" value="4"/>
  </ParameterValueSet>
</ValueSetDistribution></DeterministicMultiParameterDistribution>"""
RUNS = 4_000


def span(low: float, high: float, step: float) -> str:
    return f"""<DeterministicSingleParameterDistribution parameterName="speed">
      <DistributionRange stepWidth="{step}"><Range lowerLimit="{low}" upperLimit="{high}"/></DistributionRange>
    </DeterministicSingleParameterDistribution>"""


def expand(folder: Path, distribution: str, seed: int = 1) -> Sequence[Variation]:
    path = folder / "values.xosc"
    scenario = '<ScenarioFile filepath="scenario.xosc"/>'
    content = f"<ParameterValueDistribution>{scenario}{distribution}</ParameterValueDistribution>"
    path.write_text(f"<OpenSCENARIO>{HEAD}{content}</OpenSCENARIO>")
    return variations(path, np.random.default_rng(seed))


def deterministic(folder: Path, *parts: str) -> list[dict[str, Any]]:
    found = expand(folder, f"<Deterministic>{''.join(parts)}</Deterministic>")
    return [dict(variation.values) for variation in found]


def draws(folder: Path, law: str, options: str = "", seed: int = 1, runs: int = RUNS) -> list[Any]:
    part = f'<StochasticDistribution parameterName="speed">{law}</StochasticDistribution>'
    found = expand(folder, f'<Stochastic numberOfTestRuns="{runs}" {options}>{part}</Stochastic>', seed)
    return [variation.values["speed"] for variation in found]


def test_sets_ranges_and_pairs_are_combined(tmp_path: Path) -> None:
    found = deterministic(tmp_path, SET, PAIRS, span(0.1, 0.3, 0.1).replace("speed", "gap"))
    assert len(found) == 2 * 2 * 3
    assert found[0] == {"owner": "ego", "speed": "1", "runs": "2", "gap": 0.1}
    assert [row["gap"] for row in found[:3]] == [0.1, 0.2, 0.3]
    assert found[-1] == {"owner": "other", "speed": "3", "runs": "4", "gap": 0.3}


@pytest.mark.parametrize(("limits", "count"), [((0, 1, 0.25), 5), ((0, 1, 0.3), 4), ((2, 2, 1), 1), ((-1, 1, 5), 1)])
def test_a_range_has_its_upper_limit_if_a_step_ends_there(
    limits: tuple[float, float, float], count: int, tmp_path: Path
) -> None:
    assert len(deterministic(tmp_path, span(*limits))) == count


def test_variations_are_values_for_their_scenario(tmp_path: Path) -> None:
    write_hand_written_scenario(tmp_path)
    speeds = []
    for variation in expand(tmp_path, f"<Deterministic>{span(10, 30, 10)}{SET}</Deterministic>"):
        scenario = resolve(variation.path, variation.values).scenario
        speeds.append(scenario.entities[0].body.performance.max_speed_mps)
    assert speeds == [10, 10, 20, 20, 30, 30]


def test_a_scenario_itself_has_one_variation(tmp_path: Path) -> None:
    path = write_hand_written_scenario(tmp_path)
    assert variations(path, np.random.default_rng(0)) == [Variation(path, {})]


NORMAL = '<NormalDistribution expectedValue="10" variance="4">{}</NormalDistribution>'
LOG_NORMAL = '<LogNormalDistribution expectedValue="10" variance="4"/>'
POISSON = '<PoissonDistribution expectedValue="4"/>'
UNIFORM = '<UniformDistribution><Range lowerLimit="2" upperLimit="8"/></UniformDistribution>'
RANGE = '<Range lowerLimit="9" upperLimit="10"/>'


@pytest.mark.parametrize(
    ("law", "mean", "variance"),
    [(NORMAL.format(""), 10, 4), (LOG_NORMAL, 10, 4), (POISSON, 4, 4), (UNIFORM, 5, 3)],
)
def test_random_values_have_the_mean_and_variance_of_their_law(
    law: str, mean: float, variance: float, tmp_path: Path
) -> None:
    values = np.array(draws(tmp_path, law))
    assert len(values) == RUNS
    assert values.mean() == pytest.approx(mean, abs=5 * math.sqrt(variance / RUNS))
    assert values.var() == pytest.approx(variance, rel=0.15)


def test_values_of_a_law_with_a_range_lie_inside(tmp_path: Path) -> None:
    values = np.array(draws(tmp_path, NORMAL.format(RANGE)))
    assert ((values >= 9) & (values <= 10)).all()
    assert values.std() > 0.2


def test_a_histogram_has_the_weights_of_its_bins(tmp_path: Path) -> None:
    bins = [(1, 0, 1), (3, 5, 6)]
    parts = "".join(f'<Bin weight="{w}"><Range lowerLimit="{a}" upperLimit="{b}"/></Bin>' for w, a, b in bins)
    values = np.array(draws(tmp_path, f"<Histogram>{parts}</Histogram>"))
    assert np.mean(values > 4) == pytest.approx(0.75, abs=0.04)
    assert ((values >= 0) & (values <= 1) | (values >= 5) & (values <= 6)).all()


def test_a_set_of_texts_has_the_probabilities_of_its_elements(tmp_path: Path) -> None:
    parts = '<Element value="a" weight="1"/><Element value="b" weight="4"/>'
    values = draws(tmp_path, f"<ProbabilityDistributionSet>{parts}</ProbabilityDistributionSet>")
    assert values.count("b") / RUNS == pytest.approx(0.8, abs=0.04)


def test_random_values_follow_the_generator_or_the_seed_of_the_file(tmp_path: Path) -> None:
    few: Callable[..., list[Any]] = lambda **options: draws(tmp_path, UNIFORM, runs=5, **options)  # noqa: E731
    assert few(seed=1) == few(seed=1) != few(seed=2)
    assert few(seed=1, options='randomSeed="3"') == few(seed=2, options='randomSeed="3"')


def test_a_float_is_rounded_for_an_integer_parameter(tmp_path: Path) -> None:
    scenario = resolve(write_hand_written_scenario(tmp_path), {"runs": 2.6}).scenario
    assert scenario.parameters[1].value == "3"


@pytest.mark.parametrize(
    ("distribution", "words"),
    [
        (f"<Deterministic>{span(0, 1, 0)}</Deterministic>", "values.xosc:2: must have a stepWidth above 0"),
        (f"<Deterministic>{span(1, 0, 1)}</Deterministic>", "values.xosc:2: must have a stepWidth above 0"),
        (f"<Deterministic>{span(0, MAX_VARIATIONS, 1)}</Deterministic>", "more than 10,000 variations"),
        (f"<Deterministic>{SET * 14}</Deterministic>", "more than 10,000 variations"),
        (
            f"<Deterministic>{SET.replace('DistributionSet', 'UserDefinedDistribution')}</Deterministic>",
            "not supported",
        ),
        ('<Stochastic numberOfTestRuns="0">{}</Stochastic>', "numberOfTestRuns is '0'; must be at least 1"),
        ('<Stochastic numberOfTestRuns="10001">{}</Stochastic>', "more than 10,000 variations"),
        ('<Stochastic numberOfTestRuns="2">{}</Stochastic>', "no value of 1,000 lies in the range"),
        ("", "must have 1 of Deterministic or Stochastic, not 0"),
    ],
)
def test_an_impossible_distribution_is_named(distribution: str, words: str, tmp_path: Path) -> None:
    far = NORMAL.format('<Range lowerLimit="900" upperLimit="901"/>')
    part = f'<StochasticDistribution parameterName="speed">{far}</StochasticDistribution>'
    with pytest.raises(InputError, match=words):
        expand(tmp_path, distribution.format(part))
