"""Writes the roads of a map as a file of another form, chosen by its suffix."""

from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

from simbev_ros.export.maps.exact_opendrive import exact_opendrive
from simbev_ros.export.maps.lanelet2_file import lanelet2_of, projector_info
from simbev_ros.export.maps.osm_file import osm_of
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.files.whole_files import write_errors, write_whole
from simbev_ros.maps.lanelet2.projector_info import FILE_NAME
from simbev_ros.maps.network import RoadNetwork


def write_map(network: RoadNetwork, path: Path) -> None:
    """Write a map to a file, replacing it; a Lanelet2 file with ``map_projector_info.yaml`` in the same folder.

    Args:
        network: The map.
        path: Its suffix chooses the form, one of ``WRITERS``.

    Raises:
        InputError: The suffix names no form, a file cannot be written, or the folder holds another map's projector.
    """
    writer, files = writer_of(path), dict[Path, bytes]()
    if writer is lanelet2_of:
        beside = path.parent / FILE_NAME
        files[beside] = projector_info(network.datum)
        with write_errors(beside):
            if beside.exists() and beside.read_bytes() != files[beside]:
                raise InputError(f"{beside}: belongs to another map; choose a folder without one for {path.name}")
    for file, content in {path: writer(network), **files}.items():
        with write_errors(file):
            write_whole(file, content)


def files_of(path: Path) -> list[Path]:
    """The files that ``write_map`` writes.

    Raises:
        InputError: The suffix names no form.
    """
    return [path, *([path.parent / FILE_NAME] if writer_of(path) is lanelet2_of else [])]


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
    """The map's OpenDRIVE file: of an OpenDRIVE map its own, of a net the one that netconvert made."""
    names = {strip.lane for strip in network.layout.strips}
    if names.isdisjoint(network.lanes) and not any("/" in name for name in names):  # lanes of neither, but of Lanelet2
        return exact_opendrive(network)
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


WRITERS: dict[str, Callable[[RoadNetwork], bytes]] = {
    ".xodr": _opendrive,
    ".net.xml": _sumo_net,
    "lanelet2_map.osm": lanelet2_of,
    ".lanelet2.osm": lanelet2_of,
    ".osm": osm_of,
}
"""Suffix of a file → function that makes its content; the first one that fits."""
