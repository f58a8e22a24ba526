"""Imports a Lanelet2 map: takes an .osm file of lanelets and returns the parts of a map.

The layout follows the bounds in the file exactly. The SUMO net is made from the same lanelets, so that vehicles drive
on the lanes of the layout. The OpenDRIVE file is the one that netconvert makes from that net.
"""

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

from simbev_ros.foundation.errors import InputError, SimulationError
from simbev_ros.foundation.geometry.geodesy import MapDatum
from simbev_ros.maps.findings import Findings
from simbev_ros.maps.lane_graph.crossings import crosswalks_of_net, planned_crossings
from simbev_ros.maps.lane_graph.sumo_xml import RightOfWay, build_net
from simbev_ros.maps.lane_graph.traffic import Traffic
from simbev_ros.maps.lane_graph.verges import with_verges
from simbev_ros.maps.lanelet2.assumed_paint import with_assumed_paint
from simbev_ros.maps.lanelet2.document import LaneletMap
from simbev_ros.maps.lanelet2.junctions import junctions_of
from simbev_ros.maps.lanelet2.land import land_of
from simbev_ros.maps.lanelet2.reader import read_lanelet_map
from simbev_ros.maps.lanelet2.roadside import Roadside, signal_places, signs_of, speed_bumps_of, stop_lines_of
from simbev_ros.maps.lanelet2.rules import Rule, rules_of, waiting_at_crosswalks, with_speed_limits
from simbev_ros.maps.lanelet2.shapes import LaneletShape, are_left_handed, lanelet_shapes
from simbev_ros.maps.lanelet2.strips import area_strips, crosswalks_of, lanelet_strips
from simbev_ros.maps.lanelet2.topology import Topology, topology_of
from simbev_ros.maps.lanelet2.traffic import traffic_of
from simbev_ros.maps.parts import MapParts
from simbev_ros.maps.roads.layout import Crosswalk, Layout, SignKind


def import_lanelet2(path: Path, work: Path) -> MapParts:
    """Import a Lanelet2 map.

    Args:
        path: The .osm file.
        work: An empty folder for the resulting files.

    Raises:
        InputError: The file is not OSM XML, is too large, or has no lanelet for vehicles.
    """
    source, shapes, datum, notes = _read(path)
    junctions = with_assumed_paint(junctions_of(topology_of(path, shapes, datum)), notes)
    rules = rules_of(source, junctions, notes)
    waiting = {name for rule in rules if rule.meaning != SignKind.SPEED_LIMIT for name in rule.lanelets}
    crosswalks = crosswalks_of(shapes)
    traffic = traffic_of(junctions, waiting | waiting_at_crosswalks(crosswalks, junctions.topology), notes)
    if not traffic.is_drivable:
        reasons = "".join(f"; {sentence}" for sentence in notes.sentences()[:3])
        raise InputError(f"{path}: it has no lanelet for vehicles{reasons}")
    left_hand = junctions.topology.left_hand
    strips = (*lanelet_strips(junctions), *area_strips(source.areas))
    paved, traffic = traffic, with_verges(traffic, strips, left_hand, notes)
    right_of_way = _right_of_way(rules, junctions.topology, traffic, crosswalks)
    try:
        net = build_net(traffic, right_of_way, left_hand, work, "" if datum.heading_rad else datum.proj_string)
    except SimulationError as error:
        raise InputError(f"{path}: {error}") from None
    lane_ids, roadside = traffic.lane_ids(), Roadside(strips)
    layout = Layout(
        strips=strips,
        crosswalks=crosswalks or (crosswalks_of_net(net) if traffic is paved else ()),
        stop_lines=stop_lines_of(source.lines.values(), rules, junctions.topology),
        signs=signs_of(rules, junctions.topology, lane_ids, roadside),
        signal_places=signal_places(rules, junctions.topology, lane_ids, roadside),
    )
    features = replace(land_of(source.areas, strips, notes), speed_bumps=tuple(speed_bumps_of(source)))
    return MapParts(net, work / "sumo.xodr", datum, features, layout, findings=notes.all())


def _read(path: Path, mirrored: bool = False) -> tuple[LaneletMap, list[LaneletShape], MapDatum, Findings]:
    """Read a file; mirrored if its coordinates turn out to be left-handed, as CARLA's are."""
    notes = Findings(path)
    if mirrored:
        notes.assumed("its coordinates are left-handed, with left bounds on the right: the map is mirrored")
    source, datum = read_lanelet_map(path, notes, mirrored)
    source = with_speed_limits(source)
    shapes = list(lanelet_shapes(source, notes))
    return _read(path, True) if not mirrored and are_left_handed(shapes) else (source, shapes, datum, notes)


def _right_of_way(
    rules: Iterable[Rule], topology: Topology, traffic: Traffic, crosswalks: Sequence[Crosswalk]
) -> RightOfWay:
    """Right of way of the edges that end at lanelets with rules."""
    lane_ids = traffic.lane_ids()
    edges: dict[str, set[str]] = defaultdict(set)
    for rule in rules:
        for name in rule.lanelets:
            edges[rule.meaning].update(
                lane.rsplit("_", 1)[0] for lane in lane_ids.get(topology.shapes[name].key, ())[-1:]
            )
    signalized_nodes = {edge.end for edge in traffic.edges if edge.id in edges["traffic_light"]}
    crossings = planned_crossings(crosswalks, traffic, signalized_nodes, topology.left_hand)
    return RightOfWay(signalized_nodes, edges["yield"], edges["stop"], crossings)
