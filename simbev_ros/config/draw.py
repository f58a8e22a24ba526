"""Values that are fixed or drawn at random.

Examples: ``4``, ``{uniform: [0, 100]}``, ``{beta: [0.8, 1.0], scale: 100}``.
"""

import math
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import AfterValidator, Discriminator, Field, Tag, model_validator

from simbev_ros.config.base import Model

_Pair = tuple[float, float]
_KINDS = ("uniform", "integer", "beta", "normal", "lognormal", "choice")


class Distribution(Model):
    """A distribution of numbers: a value is drawn, then multiplied by scale, shifted by offset, and clipped.

    Exactly one of uniform [low, high], integer [low, high] (both included), beta [a, b], normal [mean, sigma],
    lognormal [mean, sigma of the logarithm] and choice [values] must be given.
    """

    uniform: _Pair | None = Field(None, description="uniform between low and high")
    integer: tuple[int, int] | None = Field(None, description="whole numbers from low to high, both included")
    beta: _Pair | None = Field(None, description="beta distribution with parameters a, b")
    normal: _Pair | None = Field(None, description="normal distribution with mean and sigma")
    lognormal: _Pair | None = Field(None, description="lognormal distribution with mean and sigma of the logarithm")
    choice: Annotated[list[float], Field(min_length=1)] | None = Field(None, description="equally likely values")
    scale: float = Field(1.0, description="factor by which the drawn value is multiplied")
    offset: float = Field(0.0, description="offset that is added after scaling")
    min: float | None = Field(None, description="lower clipping bound")
    max: float | None = Field(None, description="upper clipping bound")

    @model_validator(mode="before")
    @classmethod
    def _exactly_one_kind(cls, data: Any) -> Any:
        if isinstance(data, dict):
            kinds = [kind for kind in _KINDS if data.get(kind) is not None]
            if len(kinds) != 1:
                found = " and ".join(kinds) if kinds else "none"
                raise ValueError(f"a distribution needs exactly one of {', '.join(_KINDS)}; found {found}")
        return data

    @model_validator(mode="after")
    def _valid_parameters(self) -> Self:
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
        if self.min is not None and self.max is not None and self.min > self.max:
            raise ValueError(f"min {self.min} is above max {self.max}")
        return self

    @property
    def support(self) -> _Pair:
        """Smallest and largest value that can be drawn; infinite where there is no bound."""
        low, high = self._raw_support
        ends = sorted((end * self.scale if self.scale else 0.0) + self.offset for end in (low, high))
        return self._clip(ends[0]), self._clip(ends[1])

    @property
    def _raw_support(self) -> _Pair:
        if self.uniform is not None:
            return self.uniform
        if self.integer is not None:
            return float(self.integer[0]), float(self.integer[1])
        if self.beta is not None:
            return 0.0, 1.0
        if self.choice is not None:
            return min(self.choice), max(self.choice)
        return (0.0 if self.lognormal is not None else -math.inf), math.inf

    def __str__(self) -> str:
        kind = next(kind for kind in _KINDS if getattr(self, kind) is not None)
        text = f"{kind} {', '.join(f'{value:g}' for value in getattr(self, kind))}"
        text += f" times {self.scale:g}" if self.scale != 1 else ""
        text += f" plus {self.offset:g}" if self.offset else ""
        text += f", at least {self.min:g}" if self.min is not None else ""
        return text + (f", at most {self.max:g}" if self.max is not None else "")

    def sample(self, rng: np.random.Generator) -> float:
        """Draw a value."""
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
        return self._clip(float(value * self.scale + self.offset))

    def _clip(self, value: float) -> float:
        value = value if self.min is None else max(value, self.min)
        return value if self.max is None else min(value, self.max)


def _paper_or_drawn_tag(value: Any) -> str:
    if isinstance(value, (dict, Distribution)):
        return "distribution"
    return "paper" if value == "paper" else "number"


class Options(Model):
    """Words, such as names of presets, one of which is drawn."""

    choice: Annotated[tuple[str, ...], Field(min_length=1)] = Field(description="equally likely words")

    def sample(self, rng: np.random.Generator) -> str:
        """Draw a word."""
        return self.choice[int(rng.integers(len(self.choice)))]


def _drawn_or_chosen_tag(value: Any) -> str:
    words = value.get("choice") if isinstance(value, dict) else getattr(value, "choice", None)
    is_chosen = isinstance(words, (list, tuple)) and any(isinstance(word, str) for word in words)
    return "options" if is_chosen else "distribution"


DrawnOrChosen = Annotated[
    Annotated[Distribution, Tag("distribution")] | Annotated[Options, Tag("options")],
    Discriminator(_drawn_or_chosen_tag),
]
"""A distribution of numbers, or words of which one is drawn."""

Drawn = Annotated[
    Annotated[float, Tag("number")] | Annotated[Distribution, Tag("distribution")],
    Discriminator(lambda value: "distribution" if isinstance(value, (dict, Distribution)) else "number"),
]
"""A number, or a distribution from which a number is drawn for each scene (or each actor)."""

PaperOrDrawn = Annotated[
    Annotated[float, Tag("number")]
    | Annotated[Distribution, Tag("distribution")]
    | Annotated[Literal["paper"], Tag("paper")],
    Discriminator(_paper_or_drawn_tag),
]
"""Like ``Drawn``, or ``paper`` for the paper's rule for this parameter, which may depend on others."""


def within(low: float, high: float = math.inf) -> AfterValidator:
    """Validator which ensures that a ``Drawn`` or ``PaperOrDrawn`` can only give values in [low, high]."""

    def check(value: float | Distribution | str) -> float | Distribution | str:
        ends = value.support if isinstance(value, Distribution) else (value, value)
        if not isinstance(value, str) and (ends[0] < low or ends[1] > high):  # type: ignore[operator]
            found = f"draws from {ends[0]:g} to {ends[1]:g}" if isinstance(value, Distribution) else f"is {value:g}"
            hint = "; bound it with min and max" if isinstance(value, Distribution) else ""
            raise ValueError(f"{found}, but {low:g} to {high:g} is allowed{hint}")
        return value

    return AfterValidator(check)


def sample(value: float | Distribution, rng: np.random.Generator) -> float:
    """Return a fixed value, or draw from a distribution."""
    return value.sample(rng) if isinstance(value, Distribution) else float(value)
