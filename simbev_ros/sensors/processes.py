"""Random processes in time that errors of sensors follow.

Each has steps of equal length from the scene's start on and draws equally much at each of them, so that its value at a
step depends on the seed and the step alone, whichever are asked for (live graphs may drop ticks), in rising order.
"""

import math

import numpy as np

from simbev_ros.types import Float64Array


class Drift:
    """Three independent errors that drift: ``v[n + 1] = keep · v[n] + step · N(0, 1)``."""

    def __init__(self, rng: np.random.Generator, start: Float64Array, keep: float, step: Float64Array) -> None:
        """At step 0.

        Args:
            rng: A generator of its own.
            start: (3,) values now.
            keep: What is left of a value one step later.
            step: (3,) standard deviation of what is added at each step.
        """
        self._rng, self._keep, self._step = rng, keep, step
        self._latest = start
        self._index = 0

    @classmethod
    def random_walk(cls, rng: np.random.Generator, sigma_per_sqrt_s: float, step_s: float) -> "Drift":
        """From zero, with standard deviation ``sigma_per_sqrt_s · √t`` after t seconds."""
        return cls(rng, np.zeros(3), 1.0, np.full(3, sigma_per_sqrt_s * math.sqrt(step_s)))

    @classmethod
    def gauss_markov(cls, rng: np.random.Generator, sigma: Float64Array, time_s: float, step_s: float) -> "Drift":
        """First order and stationary: (3,) standard deviations at any time, correlation ``exp(-t / time_s)``."""
        keep = math.exp(-step_s / time_s)
        return cls(rng, sigma * rng.standard_normal(3), keep, sigma * math.sqrt(1.0 - keep**2))

    def until(self, index: int, count: int = 1) -> Float64Array:
        """(count, 3) values at ``index`` and the steps just before it, none of which has been asked for before."""
        values = [self._latest] if self._index > index - count else []
        while self._index < index:
            self._latest = self._keep * self._latest + self._step * self._rng.standard_normal(3)
            self._index += 1
            if self._index > index - count:
                values.append(self._latest)
        return np.array(values)


class Outages:
    """Now and then off: a Markov chain in continuous time, looked at in steps."""

    def __init__(self, rng: np.random.Generator, share: float, mean_s: float, step_s: float) -> None:
        """At step 0, like any other time.

        Args:
            rng: A generator of its own.
            share: Of time that it is off, below 1.
            mean_s: How long it is off on average.
            step_s: Length of a step.
        """
        self._rng = rng
        memory = math.exp(-step_s / (mean_s * (1.0 - share)))  # changes there and back have the rate 1 / that time
        self._off_after = {True: share + (1.0 - share) * memory, False: share * (1.0 - memory)}
        self._off = bool(rng.random() < share)
        self._index = 0

    def at(self, index: int) -> bool:
        """Whether it is off at a step."""
        while self._index < index:
            self._off = bool(self._rng.random() < self._off_after[self._off])
            self._index += 1
        return self._off
