"""Values that are fixed or drawn, such as ``4``, ``{uniform: [0, 100]}`` or ``{beta: [0.8, 1.0], scale: 100}``."""

import math
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from simbev_ros.config.base import Model

_Pair = tuple[float, float]


class Distribution(Model):
    """One distribution, then ``value * scale + offset``, then clipping to [min, max].

    Exactly one of uniform [low, high], integer [low, high] (both included), beta [a, b], normal [mean, sigma],
    lognormal [mu, sigma of the logarithm] and choice [values] is given.
    """

    uniform: _Pair | None = None
    integer: tuple[int, int] | None = None
    beta: _Pair | None = None
    normal: _Pair | None = None
    lognormal: _Pair | None = None
    choice: Annotated[list[float], Field(min_length=1)] | None = None
    scale: float = 1.0
    offset: float = 0.0
    min: float = -math.inf
    max: float = math.inf

    @model_validator(mode="before")
    @classmethod
    def _kinds(cls, data: Any) -> Any:
        if isinstance(data, dict):
            kinds = [kind for kind in _KINDS if data.get(kind) is not None]
            if len(kinds) != 1:
                raise ValueError(f"give exactly one of {', '.join(_KINDS)}; found {len(kinds)}: {', '.join(kinds)}")
        return data

    @model_validator(mode="after")
    def _parameters(self) -> Self:
        for name in ("uniform", "integer"):
            bounds = getattr(self, name)
            if bounds is not None and bounds[0] > bounds[1]:
                raise ValueError(f"{name}: the lower bound {bounds[0]} is above the upper bound {bounds[1]}")
        if self.beta is not None and min(self.beta) <= 0:
            raise ValueError(f"beta: both parameters must be above 0, not {list(self.beta)}")
        for name in ("normal", "lognormal"):
            parameters = getattr(self, name)
            if parameters is not None and parameters[1] < 0:
                raise ValueError(f"{name}: sigma must not be negative, but is {parameters[1]}")
        if self.min > self.max:
            raise ValueError(f"min {self.min} is above max {self.max}")
        return self

    def sample(self, rng: np.random.Generator) -> float:
        """One draw."""
        if self.uniform is not None:
            value = rng.uniform(*self.uniform)
        elif self.integer is not None:
            value = float(rng.integers(self.integer[0], self.integer[1], endpoint=True))
        elif self.beta is not None:
            value = rng.beta(*self.beta)
        elif self.normal is not None:
            value = rng.normal(*self.normal)
        elif self.lognormal is not None:
            value = rng.lognormal(*self.lognormal)
        else:
            assert self.choice is not None
            value = self.choice[int(rng.integers(len(self.choice)))]
        return float(min(max(value * self.scale + self.offset, self.min), self.max))


_KINDS = ("uniform", "integer", "beta", "normal", "lognormal", "choice")

Drawn = float | Distribution
"""A number, or a distribution that one is drawn from for each scene (or each actor)."""

PaperOrDrawn = Literal["paper"] | Drawn
"""``paper``: the paper's rule for this parameter, which may depend on others."""


def sample(value: Drawn, rng: np.random.Generator) -> float:
    """A number from a fixed value or a distribution."""
    return value.sample(rng) if isinstance(value, Distribution) else float(value)
