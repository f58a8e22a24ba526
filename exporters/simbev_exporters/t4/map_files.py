"""The map of a scene as Autoware loads it, from the map file in the scene's bag; this needs the simulator."""

from pathlib import Path

from simbev_exporters.recorded_roads import recorded_roads
from simbev_ros.export.maps.lanelet2_file import lanelet2_of, projector_info
from simbev_ros.maps.lanelet2.projector_info import FILE_NAME


def map_files(bag: Path) -> dict[str, bytes]:
    """Contents of the Lanelet2 file and of the file about its projection, by name.

    Raises:
        BagError: The map file in the bag is damaged, or larger than a map file may be.
        InputError: The roads cannot be built from it.
    """
    network = recorded_roads(bag)
    return {"lanelet2_map.osm": lanelet2_of(network), FILE_NAME: projector_info(network.datum)}
