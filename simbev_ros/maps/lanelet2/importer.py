"""Imports a Lanelet2 map: takes an .osm file of lanelets and returns the parts of a map.

The layout follows the bounds in the file exactly. The SUMO net is made from the same lanelets, so that vehicles drive
on the lanes of the layout. The OpenDRIVE file is the one that netconvert makes from that net.
"""

from pathlib import Path

from simbev_ros.errors import InputError, SimulationError
from simbev_ros.maps.lane_graph.crossings import crosswalks_of_net, planned_crossings
from simbev_ros.maps.lane_graph.sumo_xml import RightOfWay, build_net
from simbev_ros.maps.lanelet2.junctions import junctions_of
from simbev_ros.maps.lanelet2.reader import read_lanelet_map
from simbev_ros.maps.lanelet2.shapes import lanelet_shapes
from simbev_ros.maps.lanelet2.strips import area_strips, crosswalks_of, lanelet_strips
from simbev_ros.maps.lanelet2.topology import topology_of
from simbev_ros.maps.lanelet2.traffic import traffic_of
from simbev_ros.maps.opendrive.reading.attributes import Notes
from simbev_ros.maps.opendrive.surroundings import features_of
from simbev_ros.maps.parts import MapParts
from simbev_ros.maps.roads.layout import Layout


def import_lanelet2(path: Path, work: Path) -> MapParts:
    """Import a Lanelet2 map.

    Args:
        path: The .osm file.
        work: An empty folder for the resulting files.

    Raises:
        InputError: The file is not OSM XML, is too large, or has no lanelet for vehicles.
    """
    notes = Notes(path)
    source, datum = read_lanelet_map(path, notes)
    shapes = list(lanelet_shapes(source, notes))
    junctions = junctions_of(topology_of(path, shapes))
    traffic = traffic_of(junctions, (), notes)
    if not traffic.is_drivable:
        reasons = "".join(f"; {sentence}" for sentence in notes.sentences()[:3])
        raise InputError(f"{path}: it has no lanelet for vehicles{reasons}")
    crosswalks = crosswalks_of(shapes)
    left_hand = junctions.topology.left_hand
    crossings = planned_crossings(crosswalks, traffic, (), left_hand)
    try:
        net = build_net(traffic, RightOfWay((), (), (), crossings), left_hand, work)
    except SimulationError as error:
        raise InputError(f"{path}: {error}") from None
    strips = (*lanelet_strips(junctions), *area_strips(source.areas))
    layout = Layout(
        strips=strips,
        crosswalks=crosswalks or crosswalks_of_net(net),
        stop_lines=(),
        signs=(),
    )
    return MapParts(net, work / "sumo.xodr", datum, features_of(strips), layout, notes.sentences())
