"""Tables by condition: each row of a table is a cut of the same boxes, cells and frames."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from simbev_ros.errors import InputError
from simbev_ros.evaluation.conditions import DAYTIMES, WEATHERS, daytime_of, weather_of
from simbev_ros.evaluation.filters import BoxFilter
from simbev_ros.scene.weather import Weather

RINGS_M: tuple[float, ...] = (0.0, 20.0, 40.0, 60.0)
"""Distances from the ego at which rings begin; the last one has no end."""
_VISIBILITIES = (0.0, 0.4, 0.6, 0.8)
"""Those of nuScenes."""
_POINTS = (0, 1, 5, 20, 100)


class Conditions(NamedTuple):
    """Of one frame, as ``conditions`` names them."""

    daytime: str
    weather: str

    @classmethod
    def of(cls, weather: Weather) -> "Conditions":
        """Those of a frame with some weather."""
        return cls(daytime_of(weather), weather_of(weather))


@dataclass(frozen=True, slots=True)
class Cut:
    """What counts in one row of a table.

    Attributes:
        group: By what the table is cut; empty for the table of all.
        name: Of the row.
        boxes: Which boxes count.
        daytimes: Which frames count, of ``DAYTIMES``.
        weathers: And of ``WEATHERS``.
        of_cells: Whether it says something of cells, too, by its distances and frames.
    """

    group: str = ""
    name: str = "all"
    boxes: BoxFilter = field(default_factory=BoxFilter)
    daytimes: tuple[str, ...] = DAYTIMES
    weathers: tuple[str, ...] = WEATHERS
    of_cells: bool = True

    def __post_init__(self) -> None:
        """Raise InputError for names that there are not."""
        for what, known in (("daytimes", DAYTIMES), ("weathers", WEATHERS)):
            given = getattr(self, what)
            strange = [name for name in given if name not in known]
            if strange or not given:
                wrong = repr(strange[0]) if strange else "empty"
                raise InputError(f"{what}: {wrong} is not allowed; allowed: {', '.join(known)}")

    def has(self, conditions: Conditions) -> bool:
        """Whether a frame counts."""
        return conditions.daytime in self.daytimes and conditions.weather in self.weathers


def cuts_of(base: Cut, groups: Sequence[str], rings_m: Sequence[float] = RINGS_M) -> list[Cut]:
    """The table of all that counts, and the rows of tables that are cut by something.

    Args:
        base: What counts at all; a row is a part of it.
        groups: Of ``GROUPS``.
        rings_m: Where rings of distance begin, rising from 0 or more.

    Raises:
        InputError: A group is unknown, or rings do not rise.
    """
    unknown = [group for group in groups if group not in GROUPS]
    if unknown:
        raise InputError(f"by: there is no {unknown[0]!r}; allowed: {', '.join(GROUPS)}")
    if not rings_m or rings_m[0] < 0 or any(near >= far for near, far in pairwise(rings_m)):
        raise InputError(f"rings: {', '.join(f'{each:g}' for each in rings_m)}: must rise, the first from 0 or more")
    return [base, *(row for group in dict.fromkeys(groups) for row in GROUPS[group](base, rings_m))]


def _by_distance(base: Cut, rings_m: Sequence[float]) -> Iterator[Cut]:
    for span_m in _spans(base.boxes.range_m, rings_m):
        yield replace(
            base, group="distance", name=_words(span_m, "m"), boxes=replace(base.boxes, range_m=span_m), of_cells=True
        )


def _by_visibility(base: Cut, _rings_m: Sequence[float]) -> Iterator[Cut]:
    for span in _spans(base.boxes.visibility, _VISIBILITIES):
        boxes = replace(base.boxes, visibility=span)
        yield replace(base, group="visibility", name=_words(span), boxes=boxes, of_cells=False)


def _by_points(base: Cut, _rings_m: Sequence[float]) -> Iterator[Cut]:
    for span in _spans(base.boxes.points, _POINTS):
        yield replace(base, group="points", name=_words(span), boxes=replace(base.boxes, points=span), of_cells=False)


def _by_difficulty(base: Cut, _rings_m: Sequence[float]) -> Iterator[Cut]:
    for name in base.boxes.difficulties:
        boxes = replace(base.boxes, difficulties=(name,))
        yield replace(base, group="difficulty", name=name, boxes=boxes, of_cells=False)


def _by_daytime(base: Cut, _rings_m: Sequence[float]) -> Iterator[Cut]:
    for name in base.daytimes:
        yield replace(base, group="daytime", name=name, daytimes=(name,))


def _by_weather(base: Cut, _rings_m: Sequence[float]) -> Iterator[Cut]:
    for name in base.weathers:
        yield replace(base, group="weather", name=name, weathers=(name,))


GROUPS: Mapping[str, Callable[[Cut, Sequence[float]], Iterator[Cut]]] = {
    "distance": _by_distance,
    "visibility": _by_visibility,
    "points": _by_points,
    "difficulty": _by_difficulty,
    "daytime": _by_daytime,
    "weather": _by_weather,
}
"""What tables can be cut by."""


def _spans(within: tuple[float, float], starts: Sequence[float]) -> Iterator[tuple[float, float]]:
    """Spans that begin at some values, as far as they are within one."""
    for low, high in pairwise((*starts, np.inf)):
        low, high = max(low, within[0]), min(high, within[1])
        if low < high:
            yield low, high


def _words(span: tuple[float, float], unit: str = "") -> str:
    low, high = (f"{value:g} {unit}".strip() for value in span)
    return f"{low} and more" if span[1] == np.inf else f"{span[0]:g} to {high}"
