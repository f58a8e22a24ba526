"""Transitions: values, slopes and integrals of all shapes, by numbers and by quadrature."""

import math

import numpy as np
import pytest

from simbev_ros.simulation.world.storyboard.profiles import Transition, speed_transition, transition

SHAPES = ["linear", "cubic", "sinusoidal"]


@pytest.mark.parametrize("shape", SHAPES)
def test_slope_and_integral_are_those_of_the_value(shape: str) -> None:
    change = Transition(2.0, 7.0, 3.0, shape)
    times = np.linspace(0.0, 5.0, 50_001)
    values = np.array([change.value(t) for t in times])
    step = times[1]
    assert change.integral(5.0) == pytest.approx(np.sum(values[1:] + values[:-1]) * step / 2.0, abs=1e-6)
    inside = (times > 0.01) & (times < 2.99)
    slopes = np.array([change.slope(t) for t in times])
    np.testing.assert_allclose(np.gradient(values, step)[inside], slopes[inside], atol=1e-6)


@pytest.mark.parametrize(
    ("shape", "quarter"), [("linear", 0.25), ("cubic", 5 / 32), ("sinusoidal", (1 - math.sqrt(0.5)) / 2)]
)
def test_shapes_have_their_values_at_a_quarter_and_the_middle(shape: str, quarter: float) -> None:
    change = transition(0.0, 1.0, shape, "time", 4.0)
    assert [change.value(t) for t in (1.0, 2.0, 4.0, 9.0)] == pytest.approx([quarter, 0.5, 1.0, 1.0])


@pytest.mark.parametrize(("shape", "length_s"), [("linear", 5.0), ("cubic", 7.5), ("sinusoidal", 5.0 * math.pi / 2.0)])
def test_a_rate_is_the_largest_slope(shape: str, length_s: float) -> None:
    change = transition(10.0, 0.0, shape, "rate", 2.0)
    assert change.length == pytest.approx(length_s)
    assert min(change.slope(t) for t in np.linspace(0.0, length_s, 2001)) == pytest.approx(-2.0, abs=1e-3)


@pytest.mark.parametrize("shape", SHAPES)
def test_a_speed_that_changes_over_a_distance_travels_it_meanwhile(shape: str) -> None:
    change = speed_transition(4.0, 12.0, shape, "distance", 40.0)
    assert change.length == pytest.approx(5.0)
    assert change.integral(change.length) == pytest.approx(40.0)


def test_a_step_takes_no_time() -> None:
    assert transition(3.0, 5.0, "step", "time", 4.0) == Transition(3.0, 5.0, 0.0)
    assert Transition(3.0, 5.0, 0.0).integral(2.0) == 10.0
