"""The maps that a configuration names. Plans of datasets need only these, and not what draws scenes."""

from pathlib import Path

from simbev_ros.config.scenario import Scenario
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.random import stream
from simbev_ros.maps.source import map_spec
from simbev_ros.schema.scene.map_spec import MapSpec


def maps_of(scenario: Scenario) -> list[MapSpec]:
    """The map of each entry of a configuration's scenes, in its order; a map may occur several times.

    Raises:
        InputError: There is no such town or file; the message names the field.
    """
    return [_map_of(scenario, index) for index in range(len(scenario.scenes))]


def _map_of(scenario: Scenario, index: int) -> MapSpec:
    entry = scenario.scenes[index]
    try:
        if not entry.map:
            return map_spec(_road_network_of(entry.scenario))
        return map_spec(entry.map, bounds=entry.bounds)
    except InputError as error:
        if not entry.map:
            raise
        raise InputError(f"{scenario.where('scenes', index, 'map')}: {str(error).removeprefix('map: ')}") from None


def _road_network_of(scenario: str) -> str:
    """The map that a scenario names.

    Raises:
        InputError: The scenario cannot be read, or names none.
    """
    from simbev_ros.scene.storyboard.distributions import variations  # few plans need it, and it takes 70 ms
    from simbev_ros.scene.storyboard.reading import resolve

    first = variations(Path(scenario), stream(0, "scenario"))[0]
    name = resolve(first.path, first.values).map_name
    if name is None:
        raise InputError(f"{scenario}: names no road network; name one: scenes: [{{scenario: …, map: …, test: 1}}]")
    return name
