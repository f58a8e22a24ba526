"""Table slices: evaluation results by distance, visibility, points, difficulty, time of day, weather or map.

Each row of a table is a slice, a selection of the same boxes, cells and frames. The evaluation tallies every slice.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from simbev_ros.config.evaluation import RINGS_M
from simbev_ros.evaluation.conditions import DAYTIMES, WEATHERS, daytime_of, weather_of
from simbev_ros.evaluation.filters import BoxFilter
from simbev_ros.foundation.errors import InputError
from simbev_ros.schema.scene.spec import SceneSpec

_VISIBILITIES = (0.0, 0.4, 0.6, 0.8)
"""Lower bounds of the visibility levels, as in nuScenes."""
_POINTS = (0, 1, 5, 20, 100)


class Conditions(NamedTuple):
    """Time of day and weather of one frame, by their names in ``conditions``, and its map."""

    daytime: str
    weather: str
    map: str

    @classmethod
    def of_tick(cls, spec: SceneSpec, tick: int) -> "Conditions":
        """Conditions of a frame of a scene."""
        weather = spec.weather_at(tick)
        return cls(daytime_of(weather), weather_of(weather), spec.map.name)


@dataclass(frozen=True, slots=True)
class TableSlice:
    """Selection of boxes, cells and frames that count in one row of a table.

    Attributes:
        group: Condition by which the table is sliced; empty for the row with everything.
        name: Name of the row.
        boxes: Filter for the boxes that count.
        daytimes: Times of day of the frames that count, out of ``DAYTIMES``.
        weathers: Weathers of the frames that count, out of ``WEATHERS``.
        maps: Names of the maps that count; empty: of all maps.
        includes_cells: Whether the row also counts cells, by its distances and frames.
    """

    group: str = ""
    name: str = "all"
    boxes: BoxFilter = field(default_factory=BoxFilter)
    daytimes: tuple[str, ...] = DAYTIMES
    weathers: tuple[str, ...] = WEATHERS
    maps: tuple[str, ...] = ()
    includes_cells: bool = True

    def __post_init__(self) -> None:
        """Raise InputError for unknown names."""
        for field_name, known in (("daytimes", DAYTIMES), ("weathers", WEATHERS)):
            given = getattr(self, field_name)
            unknown = [name for name in given if name not in known]
            if unknown or not given:
                wrong = repr(unknown[0]) if unknown else "empty"
                raise InputError(f"{field_name}: {wrong} is not allowed; allowed: {', '.join(known)}")

    @property
    def includes_tracks(self) -> bool:
        """Whether the row also measures tracks: not where boxes of a track may be in several rows of the same frame."""
        return self.group in ("", "daytime", "weather", "map")

    def has(self, conditions: Conditions) -> bool:
        """Whether a frame with these conditions counts."""
        is_on_map = not self.maps or conditions.map in self.maps
        return is_on_map and conditions.daytime in self.daytimes and conditions.weather in self.weathers


def table_slices(base: TableSlice, groups: Sequence[str], rings_m: Sequence[float] = RINGS_M) -> list[TableSlice]:
    """Make the slice of everything that counts, and the slices by the given conditions.

    Args:
        base: Everything that counts; each slice is a part of it.
        groups: Conditions to slice by, keys of ``GROUPS``; slices by map are those of the maps that ``base`` names.
        rings_m: Distances from the ego at which the rings begin, rising from 0 or more; the last one is unbounded.

    Raises:
        InputError: A group is unknown, or the rings do not rise.
    """
    unknown = [group for group in groups if group not in GROUPS]
    if unknown:
        raise InputError(f"by: there is no {unknown[0]!r}; allowed: {', '.join(GROUPS)}")
    if not rings_m or rings_m[0] < 0 or any(near >= far for near, far in pairwise(rings_m)):
        raise InputError(f"rings: {', '.join(f'{each:g}' for each in rings_m)}: must rise, the first from 0 or more")
    return [base, *(row for group in dict.fromkeys(groups) for row in GROUPS[group](base, rings_m))]


def _by_distance(base: TableSlice, rings_m: Sequence[float]) -> Iterator[TableSlice]:
    for span_m in _spans(base.boxes.range_m, rings_m):
        yield replace(
            base,
            group="distance",
            name=_span_label(span_m, "m"),
            boxes=replace(base.boxes, range_m=span_m),
            includes_cells=True,
        )


def _by_visibility(base: TableSlice, _rings_m: Sequence[float]) -> Iterator[TableSlice]:
    for span in _spans(base.boxes.visibility, _VISIBILITIES):
        boxes = replace(base.boxes, visibility=span)
        yield replace(base, group="visibility", name=_span_label(span), boxes=boxes, includes_cells=False)


def _by_points(base: TableSlice, _rings_m: Sequence[float]) -> Iterator[TableSlice]:
    for span in _spans(base.boxes.points, _POINTS):
        yield replace(
            base, group="points", name=_span_label(span), boxes=replace(base.boxes, points=span), includes_cells=False
        )


def _by_difficulty(base: TableSlice, _rings_m: Sequence[float]) -> Iterator[TableSlice]:
    for name in base.boxes.difficulties:
        boxes = replace(base.boxes, difficulties=(name,))
        yield replace(base, group="difficulty", name=name, boxes=boxes, includes_cells=False)


def _by_daytime(base: TableSlice, _rings_m: Sequence[float]) -> Iterator[TableSlice]:
    for name in base.daytimes:
        yield replace(base, group="daytime", name=name, daytimes=(name,))


def _by_weather(base: TableSlice, _rings_m: Sequence[float]) -> Iterator[TableSlice]:
    for name in base.weathers:
        yield replace(base, group="weather", name=name, weathers=(name,))


def _by_map(base: TableSlice, _rings_m: Sequence[float]) -> Iterator[TableSlice]:
    for name in base.maps:
        yield replace(base, group="map", name=name, maps=(name,))


GROUPS: Mapping[str, Callable[[TableSlice, Sequence[float]], Iterator[TableSlice]]] = {
    "distance": _by_distance,
    "visibility": _by_visibility,
    "points": _by_points,
    "difficulty": _by_difficulty,
    "daytime": _by_daytime,
    "weather": _by_weather,
    "map": _by_map,
}
"""Conditions by which tables can be sliced, each with the function that makes its slices."""


def _spans(within: tuple[float, float], starts: Sequence[float]) -> Iterator[tuple[float, float]]:
    """Spans between successive start values, clipped to ``within``."""
    for low, high in pairwise((*starts, np.inf)):
        low, high = max(low, within[0]), min(high, within[1])
        if low < high:
            yield low, high


def _span_label(span: tuple[float, float], unit: str = "") -> str:
    low, high = (f"{value:g} {unit}".strip() for value in span)
    return f"{low} and more" if span[1] == np.inf else f"{span[0]:g} to {high}"
