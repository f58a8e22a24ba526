"""Statistics of drawn scenes: the values of every parameter over many scenes, and what the configuration asks for."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np
from pydantic import BaseModel

from simbev_ros.config.draw import Distribution
from simbev_ros.config.scenario import Scenario
from simbev_ros.config.weather import WEATHER_PARAMETERS
from simbev_ros.foundation.tables import load_table
from simbev_ros.foundation.types import Float64Array
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.schema.scene.spec import SceneSpec

BINS = 20
_MAX_SAMPLES = 1 << 17  # number of values in a parameter's histogram; up to twice as many are held
_NOT_DRAWN = {
    *("number", "split", "seed", "map", "rig", "annotation", "tick_ns", "warm_up_ticks", "end_after_standing_ticks"),
    *("ticks", "vehicles", "pedestrians", "start", "color", "colors", "frames", "base_link_x_m"),
    *("agents", "v2x", "route", "stands_at", "blocked", "outline_m", "z_m", "props"),
    *("yields_to_emergency", "wrecks_cleared_s", "document"),
}
_SECTIONS = ("traffic", "ego", "time", "lights")


class Tally:
    """Running statistics of one parameter, fed in batches, in bounded memory."""

    def __init__(self) -> None:
        self.count = 0
        self.mean = 0.0
        self.min, self.max = np.inf, -np.inf
        self._squares = 0.0
        self._samples: list[Float64Array] = []
        self._stride = 1

    @property
    def sd(self) -> float:
        """Standard deviation."""
        return float(np.sqrt(self._squares / self.count)) if self.max > self.min else 0.0

    def add(self, values: Float64Array) -> None:
        """Add (N,) values, N > 0."""
        total = self.count + len(values)
        step = float(values.mean()) - self.mean
        # Combines the sums of squares about the means of two batches (Chan, Golub, LeVeque 1979).
        self._squares += float(((values - values.mean()) ** 2).sum()) + step**2 * self.count * len(values) / total
        self.mean += step * len(values) / total
        self.min, self.max = min(self.min, float(values.min())), max(self.max, float(values.max()))
        self._samples.append(values[-self.count % self._stride :: self._stride])
        self.count = total
        if sum(map(len, self._samples)) > 2 * _MAX_SAMPLES:
            self._samples = [np.concatenate(self._samples)[::2]]
            self._stride *= 2

    def shares(self) -> Float64Array:
        """(BINS,) fraction of the values in each of BINS equal bins between ``min`` and ``max``."""
        samples = np.concatenate(self._samples)
        counts, _ = np.histogram(samples, BINS, (self.min, self.max))
        return counts / len(samples)


@dataclass
class SceneStatistics:
    """Statistics of the scenes added so far.

    Attributes:
        maps: Number of scenes per map.
        numbers: Tallies of the numeric parameters; booleans count as 1 and 0.
        kinds: For parameters that are names, how often each value was drawn.
    """

    maps: Counter[str] = field(default_factory=Counter)
    numbers: dict[str, Tally] = field(default_factory=dict)
    kinds: dict[str, Counter[str]] = field(default_factory=dict)

    def add(self, spec: SceneSpec) -> None:
        """Add the drawn values of one scene."""
        self.maps[spec.map.name] += 1
        numbers: dict[str, list[float]] = {}
        for name, value in iter_drawn_values(spec):
            if isinstance(value, str):
                self.kinds.setdefault(name, Counter())[value] += 1
            else:
                numbers.setdefault(name, []).append(value)
        for name, values in numbers.items():
            self.numbers.setdefault(name, Tally()).add(np.array(values, np.float64))


def iter_drawn_values(spec: SceneSpec) -> Iterator[tuple[str, float | str]]:
    """Name and value of everything drawn for a scene except positions and colors; actors of one kind share a name."""
    yield "duration_s", spec.ticks * spec.tick_ns / NS_PER_S
    yield from _iter_values("", spec)
    stations = sum(agent.station is not None for agent in spec.agents)
    carriers = len(spec.agents) - stations
    yield "agents", float(carriers + stations)
    yield "roadside_units", float(stations)
    yield "vehicles", float(len(spec.drivers) - carriers + len(spec.entity_blueprints("vehicle")))
    yield "pedestrians", float(spec.count_of("pedestrian"))
    yield "hazards", float(len(spec.hazards))
    if spec.drive is not None:
        yield "drive.route_m", spec.drive.route.length_m
        yield "drive.events", float(len(spec.drive.events))
    yield from _iter_values("ego", spec.vehicles[0])
    yield from _iter_values("agents", spec.vehicles[1:carriers])
    yield from _iter_values("vehicles", spec.drivers[carriers:])
    yield from _iter_values("pedestrians", spec.pedestrians)


def _iter_values(name: str, value: Any) -> Iterator[tuple[str, float | str]]:
    if isinstance(value, Distribution) or value is None:
        return
    if isinstance(value, BaseModel):
        for key, inner in value:
            if key not in _NOT_DRAWN:
                yield from _iter_values(f"{name}.{key}" if name else key, inner)
    elif isinstance(value, tuple):
        for inner in value:
            yield from _iter_values(name, inner)
    elif isinstance(value, (str, int, float)):
        yield name, value if isinstance(value, str) else float(value)


def configured_value(name: str, scenario: Scenario) -> str:
    """Describe the value or distribution that the configuration sets for a parameter; empty if it sets none."""
    facts = _facts()
    for path in _candidate_fields(name, facts["fields"]):
        value = _field_of(scenario, path)
        if (
            value is None
            or isinstance(value, tuple)
            or (isinstance(value, BaseModel) and type(value) is not Distribution)
        ):
            continue
        if value == "paper":
            weather = WEATHER_PARAMETERS.get(path.rpartition(".")[2])
            return str(facts["paper"].get(path, weather.paper if weather else "the paper's rule"))
        limits = f", {facts['only'][path]}" if path in facts["only"] else ""
        return _describe(value, is_probability=path.endswith("_probability") > name.endswith("_probability")) + limits
    return ""


def _field_of(scenario: Scenario, path: str) -> Any:
    """Value of a field; of the fields of several vehicles the one value that all have; None if there is none."""
    value: Any = scenario
    for key in path.split("."):
        models = value if isinstance(value, tuple) else (value,)
        values = [getattr(each, key, None) for each in models if getattr(each, "mast", None) is None]
        value = values[0] if values and all(each == values[0] for each in values) else None
    return value


def _describe(value: Distribution | float | str, is_probability: bool) -> str:
    if is_probability:
        return f"yes with probability {value}"
    if isinstance(value, Distribution):
        return str(value)
    return f"fixed: {value:g}" if isinstance(value, float) else f"fixed: {value}"


def _candidate_fields(name: str, fields: dict[str, str]) -> Iterator[str]:
    """Configuration fields that may control a parameter, most specific first."""
    if name in fields:
        yield fields[name]
        return
    name = name.replace("final_weather.", "weather.final.")
    leaf = name.rsplit(".", 1)[-1]
    yield name
    yield f"{name}_probability"
    for section in _SECTIONS:
        yield f"{section}.{leaf}"
        yield f"{section}.{leaf}_probability"


@lru_cache(maxsize=1)
def _facts() -> dict[str, Any]:
    return load_table("simbev_ros.scene.drawing", "parameters.yaml")
