"""Transitions of OpenSCENARIO: a value goes to another one with a shape, exactly at any time.

Shapes and dimensions are those of ``TransitionDynamics`` (ASAM OpenSCENARIO XML 1.3). A rate is the largest one of the
transition; a distance is what an entity travels meanwhile.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple


class _Shape(NamedTuple):
    """A shape from (0, 0) to (1, 1), its derivative, its integral from 0, and its steepest slope."""

    value: Callable[[float], float]
    slope: Callable[[float], float]
    area: Callable[[float], float]
    steepest: float


_SHAPES: Mapping[str, _Shape] = {
    "linear": _Shape(lambda u: u, lambda u: 1.0, lambda u: u * u / 2.0, 1.0),
    "cubic": _Shape(lambda u: u * u * (3.0 - 2.0 * u), lambda u: 6.0 * u * (1.0 - u), lambda u: u**3 - u**4 / 2.0, 1.5),
    "sinusoidal": _Shape(
        lambda u: (1.0 - math.cos(math.pi * u)) / 2.0,
        lambda u: math.pi / 2.0 * math.sin(math.pi * u),
        lambda u: u / 2.0 - math.sin(math.pi * u) / (2.0 * math.pi),
        math.pi / 2.0,
    ),
}


@dataclass(frozen=True, slots=True)
class Transition:
    """A value over time, or over distance: constant before and after the transition.

    Attributes:
        start: Value at 0.
        end: Value from ``length`` on.
        length: Duration in seconds, or distance in meters; 0: a step.
        shape: Name of the shape.
    """

    start: float
    end: float
    length: float
    shape: str = "linear"

    def value(self, at: float) -> float:
        """The value at a time or distance."""
        if at >= self.length:
            return self.end
        return self.start + (self.end - self.start) * _SHAPES[self.shape].value(max(at, 0.0) / self.length)

    def slope(self, at: float) -> float:
        """Its derivative."""
        if at >= self.length:
            return 0.0
        return (self.end - self.start) / self.length * _SHAPES[self.shape].slope(max(at, 0.0) / self.length)

    def integral(self, at: float) -> float:
        """Its integral from 0."""
        part = min(at, self.length)
        area = self.length * _SHAPES[self.shape].area(part / self.length) if self.length > 0.0 else 0.0
        return self.start * part + (self.end - self.start) * area + self.end * (at - part)


def transition(start: float, end: float, shape: str, dimension: str, value: float) -> Transition:
    """The transition of a lateral position, or of a speed whose dimension is not a distance.

    Args:
        start: Value at its start.
        end: Value at its end.
        shape: linear, cubic, sinusoidal or step.
        dimension: time or distance: ``value`` is the length; rate: the largest slope.
        value: Not negative.
    """
    if shape == "step" or start == end:
        return Transition(start, end, 0.0)
    length = abs(end - start) * _SHAPES[shape].steepest / value if dimension == "rate" else value
    return Transition(start, end, length, shape)


def speed_transition(start_mps: float, end_mps: float, shape: str, dimension: str, value: float) -> Transition:
    """The transition of a speed over time; while it lasts, an entity travels the distance that may be given.

    All shapes are symmetric, so the mean speed is that of start and end.
    """
    if dimension == "distance" and shape != "step":
        mean_mps = abs(start_mps + end_mps) / 2.0
        dimension, value = "time", value / mean_mps if mean_mps else 0.0
    return transition(start_mps, end_mps, shape, dimension, value)
