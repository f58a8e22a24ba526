"""Writes a map as a file of another form, chosen by its suffix: its roads, or points on its surfaces."""

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from xml.etree import ElementTree

from simbev_ros.assets.placement.static_scene import Tile
from simbev_ros.export.maps.exact_opendrive import exact_opendrive
from simbev_ros.export.maps.lanelet2_file import autoware_rise_m, lanelet2_of, projector_info
from simbev_ros.export.maps.osm_file import osm_of
from simbev_ros.export.maps.point_map import point_map_of, scanners_of
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.files.whole_files import write_errors, write_whole
from simbev_ros.maps.lanelet2.projector_info import FILE_NAME
from simbev_ros.maps.network import RoadNetwork

_Regions = Iterable[Sequence[Tile]]
Writer = Callable[[RoadNetwork, _Regions], list[bytes]]
"""Makes the pieces of a file from the roads and the surroundings of a map."""


def write_map(network: RoadNetwork, path: Path, regions: _Regions = ()) -> None:
    """Write a map to a file, replacing it; a file for Autoware with ``map_projector_info.yaml`` in the same folder.

    Args:
        network: The map.
        path: Its suffix chooses the form, one of ``WRITERS``.
        regions: Tiles of the regions of its static scene, for the points of a ``.pcd``.

    Raises:
        InputError: The suffix names no form, a file cannot be written, or the folder holds another map's projector.
    """
    writer, files = writer_of(path), dict[Path, list[bytes]]()
    if _is_for_autoware(path):
        beside = path.parent / FILE_NAME
        files[beside] = [projector_info(network.datum)]
        with write_errors(beside):
            if beside.exists() and beside.read_bytes() != files[beside][0]:
                raise InputError(f"{beside}: belongs to another map; choose a folder without one for {path.name}")
    files[path] = writer(network, regions)
    for file, content in files.items():
        with write_errors(file):
            write_whole(file, content)


def is_point_map(path: Path) -> bool:
    """Whether a file is to have the points of a map, for which ``write_map`` needs tiles."""
    return writer_of(path) is WRITERS[".pcd"]


def files_of(path: Path) -> list[Path]:
    """The files that ``write_map`` writes.

    Raises:
        InputError: The suffix names no form.
    """
    return [path, *([path.parent / FILE_NAME] if _is_for_autoware(path) else [])]


def writer_of(path: Path) -> Writer:
    """The function that writes the form of a file.

    Raises:
        InputError: The suffix names no form.
    """
    found = next((writer for suffix, writer in WRITERS.items() if path.name.lower().endswith(suffix)), None)
    if found is None:
        raise InputError(f"{path}: its name must end in {', '.join(WRITERS)}")
    return found


def _is_for_autoware(path: Path) -> bool:
    return writer_of(path) in (WRITERS["lanelet2_map.osm"], WRITERS[".pcd"])


def _lanelet2(network: RoadNetwork, _: _Regions) -> list[bytes]:
    return [lanelet2_of(network)]


def _opendrive(network: RoadNetwork, _: _Regions) -> list[bytes]:
    """The map's OpenDRIVE file: of an OpenDRIVE map its own, of a net the one that netconvert made."""
    names = {strip.lane for strip in network.layout.strips}
    if names.isdisjoint(network.lanes) and not any("/" in name for name in names):  # lanes of neither, but of Lanelet2
        return [exact_opendrive(network)]
    return [network.opendrive_path.read_bytes()]


def _sumo_net(network: RoadNetwork, _: _Regions) -> list[bytes]:
    """The SUMO net that traffic runs on, with the map's position on Earth."""
    tree = ElementTree.parse(network.net_path)
    location = tree.getroot().find("location")
    if location is not None and not network.datum.heading_rad:
        datum = network.datum
        location.set("projParameter", datum.proj_string)
        location.set("netOffset", f"{-datum.false_easting_m:.3f},{-datum.false_northing_m:.3f}")
    text = ElementTree.tostring(tree.getroot(), encoding="unicode")
    return [f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'.encode()]


WRITERS: dict[str, Writer] = {
    ".xodr": _opendrive,
    ".net.xml": _sumo_net,
    "lanelet2_map.osm": _lanelet2,
    ".lanelet2.osm": _lanelet2,
    ".osm": lambda network, _: [osm_of(network)],
    ".pcd": lambda network, regions: point_map_of(regions, scanners_of(network), autoware_rise_m(network.datum)),
}
"""Suffix of a file → function that makes its content; the first one that fits."""
