"""What drawn scenes are like: the values of every parameter over many scenes, and what they are meant to be."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from importlib.resources import files
from typing import Any

import numpy as np
import yaml
from pydantic import BaseModel

from simbev_ros.config.draw import Distribution
from simbev_ros.config.scenario import Scenario
from simbev_ros.scene.spec import NS_PER_S, SceneSpec
from simbev_ros.types import Float64Array

BINS = 20
_KEPT = 1 << 17  # values of a parameter that its histogram is made of, at most twice as many
_NOT_DRAWN = {
    *("number", "split", "seed", "map", "rig", "annotation", "tick_ns", "warm_up_ticks", "end_after_standing_ticks"),
    *("ticks", "vehicles", "pedestrians", "start", "color", "colors"),
    *("stands_at", "blocked", "outline_m", "z_m", "props"),
}
_SECTIONS = ("traffic", "ego", "time", "lights")


class Tally:
    """Values of one parameter, one batch after the other, in bounded memory."""

    def __init__(self) -> None:
        self.count = 0
        self.mean = 0.0
        self.min, self.max = np.inf, -np.inf
        self._squares = 0.0
        self._kept: list[Float64Array] = []
        self._every = 1

    @property
    def sd(self) -> float:
        """Standard deviation."""
        return float(np.sqrt(self._squares / self.count)) if self.max > self.min else 0.0

    def add(self, values: Float64Array) -> None:
        """Add (N,) values, N > 0."""
        total = self.count + len(values)
        step = float(values.mean()) - self.mean
        # Sums of squares about the means of two batches, joined (Chan, Golub, LeVeque 1979).
        self._squares += float(((values - values.mean()) ** 2).sum()) + step**2 * self.count * len(values) / total
        self.mean += step * len(values) / total
        self.min, self.max = min(self.min, float(values.min())), max(self.max, float(values.max()))
        self._kept.append(values[-self.count % self._every :: self._every])
        self.count = total
        if sum(map(len, self._kept)) > 2 * _KEPT:
            self._kept = [np.concatenate(self._kept)[::2]]
            self._every *= 2

    def shares(self) -> Float64Array:
        """(BINS,) of the values that fall between ``min`` and ``max``, in bins of equal width."""
        kept = np.concatenate(self._kept)
        counts, _ = np.histogram(kept, BINS, (self.min, self.max))
        shares: Float64Array = counts / len(kept)
        return shares


@dataclass
class SceneStatistics:
    """Statistics of the scenes added so far.

    Attributes:
        maps: Scenes of each map.
        numbers: Tallies of the parameters that are numbers, or 1 and 0 for yes and no.
        kinds: How often each value of the parameters that are names was drawn.
    """

    maps: Counter[str] = field(default_factory=Counter)
    numbers: dict[str, Tally] = field(default_factory=dict)
    kinds: dict[str, Counter[str]] = field(default_factory=dict)

    def add(self, spec: SceneSpec) -> None:
        """Add a scene."""
        self.maps[spec.map.name] += 1
        numbers: dict[str, list[float]] = {}
        for name, value in drawn_values(spec):
            if isinstance(value, str):
                self.kinds.setdefault(name, Counter())[value] += 1
            else:
                numbers.setdefault(name, []).append(value)
        for name, values in numbers.items():
            self.numbers.setdefault(name, Tally()).add(np.array(values, np.float64))


def drawn_values(spec: SceneSpec) -> Iterator[tuple[str, float | str]]:
    """Name and value of everything drawn for a scene but places and colours; a name for all actors of a sort."""
    yield "duration_s", spec.ticks * spec.tick_ns / NS_PER_S
    yield from _values("", spec)
    yield "vehicles", float(len(spec.drivers) - 1)
    yield "pedestrians", float(len(spec.pedestrians))
    yield "hazards", float(len(spec.hazards))
    yield from _values("ego", spec.vehicles[0])
    yield from _values("vehicles", spec.drivers[1:])
    yield from _values("pedestrians", spec.pedestrians)


def _values(name: str, value: Any) -> Iterator[tuple[str, float | str]]:
    if isinstance(value, Distribution) or value is None:
        return
    if isinstance(value, BaseModel):
        for key, inner in value:
            if key not in _NOT_DRAWN:
                yield from _values(f"{name}.{key}" if name else key, inner)
    elif isinstance(value, tuple):
        for inner in value:
            yield from _values(name, inner)
    elif isinstance(value, (str, int, float)):
        yield name, value if isinstance(value, str) else float(value)


def meant(name: str, scenario: Scenario) -> str:
    """What a parameter is meant to be under a configuration; empty if the configuration has no say."""
    facts = _facts()
    for path in _candidates(name, facts["fields"]):
        value: Any = scenario
        for key in path.split("."):
            value = getattr(value, key, None)
        if value is None or (isinstance(value, BaseModel) and not isinstance(value, Distribution)):
            continue
        if value == "paper":
            return str(facts["paper"].get(path.replace("weather.final.", "weather."), "the paper's rule"))
        only = f", {facts['only'][path]}" if path in facts["only"] else ""
        return _described(value, is_chance=path.endswith("_probability") > name.endswith("_probability")) + only
    return ""


def _described(value: Distribution | float | str, is_chance: bool) -> str:
    if is_chance:
        return f"yes with probability {value}"
    if isinstance(value, Distribution):
        return str(value)
    return f"fixed: {value:g}" if isinstance(value, float) else f"fixed: {value}"


def _candidates(name: str, fields: dict[str, str]) -> Iterator[str]:
    """Fields of the configuration that may govern a parameter, the most special one first."""
    if name in fields:
        yield fields[name]
    name = name.replace("final_weather.", "weather.final.")
    leaf = name.rsplit(".", 1)[-1]
    yield name
    yield f"{name}_probability"
    for section in _SECTIONS:
        yield f"{section}.{leaf}"
        yield f"{section}.{leaf}_probability"


@lru_cache(maxsize=1)
def _facts() -> dict[str, Any]:
    facts: dict[str, Any] = yaml.safe_load(
        files("simbev_ros.scene.drawing").joinpath("parameters.yaml").read_text(encoding="utf-8")
    )
    return facts
