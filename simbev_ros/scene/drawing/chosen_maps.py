"""The maps that a configuration names. Plans of datasets need only these, and not what draws scenes."""

from simbev_ros.config.scenario import Scenario
from simbev_ros.maps.source import map_spec
from simbev_ros.schema.scene.map_spec import MapSpec


def maps_of(scenario: Scenario) -> list[MapSpec]:
    """The map of each entry of a configuration's scenes, in its order; a map may occur several times.

    Raises:
        InputError: There is no such town or file.
    """
    return [map_spec(entry.map, bounds=entry.bounds) for entry in scenario.scenes]
