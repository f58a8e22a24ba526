"""The weather of a scene at each tick: as it was drawn, and from some ticks on as commands have changed it."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

from pydantic import ValidationError

from simbev_ros.config.base import first_problem
from simbev_ros.foundation.errors import InputError
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.weather import Weather

_NOTHING: Mapping[int, Weather] = MappingProxyType({})


class _Change(NamedTuple):
    """Parameters that change linearly over a number of ticks and are constant then, as are all others."""

    tick: int
    ticks: int
    parameters: Mapping[str, float]


class WeatherCourse:
    """Computes the weather of a scene, with the changes that were asked for.

    Args:
        spec: The scene.
        recorded: Weather by tick that replaces what was drawn.
    """

    def __init__(self, spec: SceneSpec, recorded: Mapping[int, Weather] = _NOTHING) -> None:
        self._spec, self._recorded = spec, recorded
        self._changes: list[_Change] = []

    @property
    def is_constant(self) -> bool:
        """Whether the weather is the same at all ticks."""
        return not self._changes and not self._recorded and self._spec.final_weather is None

    def change(self, parameters: Mapping[str, float], tick: int, ticks: int) -> None:
        """Change parameters from a tick on; a drawn change of the weather ends there.

        Args:
            parameters: New values by name.
            tick: First tick with another weather.
            ticks: Number of ticks over which the values change linearly, 1 for at once.

        Raises:
            InputError: There is no such parameter, or a value is not allowed.
        """
        try:
            Weather.model_validate({**self._spec.weather.model_dump(), **parameters})
        except ValidationError as error:
            raise InputError(first_problem(error)) from None
        self._changes = sorted([*self._changes, _Change(tick, ticks, dict(parameters))], key=lambda each: each.tick)

    def at(self, tick: int) -> Weather:
        """Weather at a tick."""
        before = min(tick, self._changes[0].tick - 1) if self._changes else tick
        weather = self._recorded.get(before) or self._spec.weather_at(before)
        following = [change.tick for change in self._changes[1:]]
        for change, end in zip(self._changes, [*following, tick + 1], strict=False):
            done = min(tick, end - 1) - change.tick + 1
            if done > 0:
                target = weather.model_copy(update=dict(change.parameters))
                weather = target if done >= change.ticks else weather.interpolate(target, done / change.ticks)
        return weather
