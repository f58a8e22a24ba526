"""The maps that a configuration names. Plans of datasets need only these, and not what draws scenes."""

from simbev_ros.config.scenario import Scenario
from simbev_ros.foundation.errors import InputError
from simbev_ros.maps.source import map_spec
from simbev_ros.schema.scene.map_spec import MapSpec


def maps_of(scenario: Scenario) -> list[MapSpec]:
    """The map of each entry of a configuration's scenes, in its order; a map may occur several times.

    Raises:
        InputError: There is no such town or file; the message names the field.
    """
    return [_map_of(scenario, index) for index in range(len(scenario.scenes))]


def _map_of(scenario: Scenario, index: int) -> MapSpec:
    try:
        return map_spec(scenario.scenes[index].map, bounds=scenario.scenes[index].bounds)
    except InputError as error:
        raise InputError(f"{scenario.where('scenes', index, 'map')}: {str(error).removeprefix('map: ')}") from None
