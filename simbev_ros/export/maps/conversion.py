"""Writes the roads of a map as a file of another form, chosen by its suffix."""

from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

from simbev_ros.export.maps.osm_file import osm_of
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.files.whole_files import write_errors, write_whole
from simbev_ros.maps.network import RoadNetwork


def write_map(network: RoadNetwork, path: Path) -> None:
    """Write a map to a file, replacing it.

    Args:
        network: The map.
        path: Its suffix chooses the form, one of ``WRITERS``.

    Raises:
        InputError: The suffix names no form, or the file cannot be written.
    """
    content = writer_of(path)(network)
    with write_errors(path):
        write_whole(path, content)


def writer_of(path: Path) -> Callable[[RoadNetwork], bytes]:
    """The function that writes the form of a file.

    Raises:
        InputError: The suffix names no form.
    """
    found = next((writer for suffix, writer in WRITERS.items() if path.name.lower().endswith(suffix)), None)
    if found is None:
        raise InputError(f"{path}: its name must end in {', '.join(WRITERS)}")
    return found


def _opendrive(network: RoadNetwork) -> bytes:
    """The map's OpenDRIVE file: of an OpenDRIVE map its own, of others the one that netconvert made."""
    return network.opendrive_path.read_bytes()


def _sumo_net(network: RoadNetwork) -> bytes:
    """The SUMO net that traffic runs on, with the map's position on Earth."""
    tree = ElementTree.parse(network.net_path)
    location = tree.getroot().find("location")
    if location is not None and not network.datum.heading_rad:
        datum = network.datum
        location.set("projParameter", datum.proj_string)
        location.set("netOffset", f"{-datum.false_easting_m:.3f},{-datum.false_northing_m:.3f}")
    text = ElementTree.tostring(tree.getroot(), encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'.encode()


WRITERS: dict[str, Callable[[RoadNetwork], bytes]] = {".xodr": _opendrive, ".net.xml": _sumo_net, ".osm": osm_of}
"""Suffix of a file → function that makes its content."""
