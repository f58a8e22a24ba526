"""Random processes that model slowly varying sensor errors and outages.

Every process advances in equal steps from the start of the scene and draws the same amount of random numbers at each.
Its value at a step therefore depends on the seed and the step alone, even if some steps are never asked for (live
graphs may drop ticks). Steps must be asked for in ascending order.
"""

import math

import numpy as np

from simbev_ros.foundation.types import Float64Array


class Drift:
    """Three independent drifting errors: ``v[n + 1] = decay · v[n] + step · N(0, 1)``."""

    def __init__(self, rng: np.random.Generator, start: Float64Array, decay: float, step: Float64Array) -> None:
        """Create the process at step 0.

        Args:
            rng: Random generator used by this process alone.
            start: (3,) initial values.
            decay: Factor of a value from one step to the next.
            step: (3,) standard deviations of the increment per step.
        """
        self._rng, self._decay, self._step = rng, decay, step
        self._latest = start
        self._index = 0

    @classmethod
    def random_walk(cls, rng: np.random.Generator, sigma_per_sqrt_s: float, step_s: float) -> "Drift":
        """Create a random walk from zero, with standard deviation ``sigma_per_sqrt_s · √t`` after t seconds."""
        return cls(rng, np.zeros(3), 1.0, np.full(3, sigma_per_sqrt_s * math.sqrt(step_s)))

    @classmethod
    def gauss_markov(cls, rng: np.random.Generator, sigma: Float64Array, time_s: float, step_s: float) -> "Drift":
        """Create a stationary first-order Gauss-Markov process: (3,) sigmas, correlation ``exp(-t / time_s)``."""
        decay = math.exp(-step_s / time_s)
        return cls(rng, sigma * rng.standard_normal(3), decay, sigma * math.sqrt(1.0 - decay**2))

    def values_until(self, index: int, count: int = 1) -> Float64Array:
        """(count, 3) values at step ``index`` and the steps just before it; none may have been asked for before."""
        values = [self._latest] if self._index > index - count else []
        while self._index < index:
            self._latest = self._decay * self._latest + self._step * self._rng.standard_normal(3)
            self._index += 1
            if self._index > index - count:
                values.append(self._latest)
        return np.array(values)


class Outages:
    """Random outages: a two-state Markov chain in continuous time, sampled at equal steps."""

    def __init__(self, rng: np.random.Generator, share: float, mean_s: float, step_s: float) -> None:
        """Create the process at step 0, in its stationary distribution.

        Args:
            rng: Random generator used by this process alone.
            share: Share of time spent in outages, below 1.
            mean_s: Mean duration of an outage.
            step_s: Length of a step.
        """
        self._rng = rng
        memory = math.exp(-step_s / (mean_s * (1.0 - share)))  # 1 / that time is the sum of both transition rates
        self._off_after = {True: share + (1.0 - share) * memory, False: share * (1.0 - memory)}
        self._off = bool(rng.random() < share)
        self._index = 0

    def is_off(self, index: int) -> bool:
        """Whether there is an outage at a step; steps must not decrease from call to call."""
        while self._index < index:
            self._off = bool(self._rng.random() < self._off_after[self._off])
            self._index += 1
        return self._off
