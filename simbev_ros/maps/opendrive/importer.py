"""Imports an OpenDRIVE file: takes a .xodr file and returns the parts of a map.

The layout follows the geometry in the file exactly. The SUMO net is made from the same lanes, so that vehicles drive on
the lanes of the layout.
"""

import re
from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import replace
from io import StringIO
from pathlib import Path
from xml.etree.ElementTree import ElementTree

from simbev_ros.foundation.errors import InputError, SimulationError
from simbev_ros.foundation.files.limits import MAX_MAP_BYTES
from simbev_ros.foundation.files.unpacking import read_unpacked
from simbev_ros.maps.findings import Findings, Outcome, sentences_of
from simbev_ros.maps.lane_graph.crossings import crosswalks_of_net, planned_crossings
from simbev_ros.maps.lane_graph.sumo_xml import RightOfWay, build_net
from simbev_ros.maps.lane_graph.traffic import Traffic
from simbev_ros.maps.lane_graph.verges import with_verges
from simbev_ros.maps.opendrive.lane_shapes import lane_shapes
from simbev_ros.maps.opendrive.links import LaneLinks
from simbev_ros.maps.opendrive.objects import crosswalks_of, stop_lines_of
from simbev_ros.maps.opendrive.reading.attributes import keep_leading_numbers
from simbev_ros.maps.opendrive.reading.datum import datum_of
from simbev_ros.maps.opendrive.reading.document import Document
from simbev_ros.maps.opendrive.reading.reader import read_document
from simbev_ros.maps.opendrive.reading.recentering import recenter
from simbev_ros.maps.opendrive.reading.tables import LANE_KINDS, NO_TRAFFIC
from simbev_ros.maps.opendrive.roadside import Carriageway, signal_places_of, signs_of
from simbev_ros.maps.opendrive.roadside_objects import objects_of
from simbev_ros.maps.opendrive.signals import Signal, read_signals
from simbev_ros.maps.opendrive.stop_lines import implied_stop_lines, signalled_stop_lines
from simbev_ros.maps.opendrive.strips import strips_of
from simbev_ros.maps.opendrive.surroundings import features_of
from simbev_ros.maps.opendrive.traffic.approaches import Approaches
from simbev_ros.maps.opendrive.traffic.traffic import traffic_of
from simbev_ros.maps.parts import MapParts
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import Layout
from simbev_ros.maps.safe_xml import is_well_formed, parse, place_of


def import_opendrive(path: Path, work: Path) -> MapParts:
    """Import an OpenDRIVE file.

    Args:
        path: The .xodr file.
        work: An empty folder for the resulting files.

    Raises:
        InputError: The file is not OpenDRIVE, or has no drivable lane.
    """
    notes = Findings(path)
    root = parse(path, "OpenDRIVE")
    keep_leading_numbers(root, notes)
    origin_m = recenter(root, notes)
    document = _with_roads_outside_junctions(read_document(path, root, notes), notes)
    links = LaneLinks(document)
    shapes = {shape.key: shape for shape in lane_shapes(document, notes)}
    strips = strips_of(document, shapes, links, notes)
    traffic = traffic_of(document, shapes, links, notes)
    if not traffic.is_drivable:
        lost = sentences_of(path.name, sorted(notes.all(), key=lambda finding: finding.outcome != Outcome.LEFT_OUT))
        reasons = "".join(f"; {sentence}" for sentence in (*lost[:3], _lane_types(document)))
        raise InputError(f"{place_of(path, root)}: it has no drivable lane{reasons}")
    left_hand = _left_hand(document)
    paved, traffic = traffic, with_verges(traffic, strips, left_hand, notes)
    approaches = Approaches(document, shapes, links)
    signals = read_signals(document, notes)
    crosswalks = crosswalks_of(document, notes)
    stop_lines = (*stop_lines_of(document, notes), *signalled_stop_lines(signals))
    edges, signalized_nodes = _edges_by_meaning(signals, approaches, traffic)
    crossings = planned_crossings(crosswalks, traffic, signalized_nodes, left_hand)
    right_of_way = RightOfWay(signalized_nodes, edges["yield"], edges["stop"], crossings)
    try:
        net = build_net(traffic, right_of_way, left_hand, work)
    except SimulationError as error:
        raise InputError(f"{path}: {error}") from None
    carriageway, lane_ids = Carriageway(strips), traffic.lane_ids()
    layout = Layout(
        strips=strips,
        crosswalks=crosswalks or (crosswalks_of_net(net) if traffic is paved else ()),
        stop_lines=(*stop_lines, *implied_stop_lines(signals, approaches, shapes, stop_lines)),
        signs=signs_of(signals, approaches, lane_ids, carriageway, notes),
        signal_places=signal_places_of(signals, approaches, lane_ids, carriageway, notes),
    )
    features = features_of(strips, *objects_of(document, notes), notes)
    datum = datum_of(root, notes)
    opendrive = _write(path, document, any(origin_m), work)
    return MapParts(net, opendrive, datum, features, layout, False, notes.all(), origin_m=origin_m)


def _with_roads_outside_junctions(document: Document, notes: Findings) -> Document:
    """The document; if all its roads are inside junctions, as in a file of one turn, they are driven like others."""
    if not document.roads or not all(road.junction for road in document.roads.values()):
        return document
    notes.assumed("all its roads are inside junctions; they are used as roads outside them")
    return replace(document, roads={key: replace(road, junction="") for key, road in document.roads.items()})


def _lane_types(document: Document) -> str:
    """Says which types of lanes a document has, for an error."""
    found = sorted({lane.type for _, _, lane in document.lanes()})
    drivable = sorted(name for name, kind in LANE_KINDS.items() if kind is LaneKind.DRIVING and name not in NO_TRAFFIC)
    return f"its lanes are of type {', '.join(found)[:200] or '(none)'}; drivable are {', '.join(drivable)}"


def _edges_by_meaning(
    signals: Iterable[Signal], approaches: Approaches, traffic: Traffic
) -> tuple[Mapping[str, set[str]], set[str]]:
    """Meaning of signals → edges that they apply to, at their ends; and the nodes with traffic lights."""
    lane_ids = traffic.lane_ids()
    by_meaning: dict[str, set[str]] = defaultdict(set)
    for signal in signals:
        for key in approaches.waiting_lanes(signal.lanes):
            by_meaning[signal.meaning].update(lane_id.rsplit("_", 1)[0] for lane_id in lane_ids.get(key, ())[-1:])
    return by_meaning, {edge.end for edge in traffic.edges if edge.id in by_meaning["traffic_light"]}


def _left_hand(document: Document) -> bool:
    """Whether traffic keeps to the left on most of the road length."""
    return sum(road.length_m * (1.0 if road.left_hand else -1.0) for road in document.roads.values()) > 0.0


def _write(path: Path, document: Document, is_recentered: bool, work: Path) -> Path:
    """Write the file as UTF-8; unchanged if it is well-formed UTF-8 already and was not recentered."""
    target = work / "map.xodr"
    try:
        content = b"".join(read_unpacked(path, MAX_MAP_BYTES))
        text = StringIO(content.decode("utf-8-sig"), newline=None).getvalue()
        text = text if is_well_formed(content) else ""
    except UnicodeDecodeError:
        text = ""
    declared = re.match(r"""\s*<\?xml[^>]*encoding=["']([^"']+)""", text)
    if text and not is_recentered and (declared is None or declared[1].upper() in ("UTF-8", "US-ASCII", "ASCII")):
        target.write_text(text, encoding="utf-8")
    else:
        ElementTree(document.root).write(target, encoding="utf-8", xml_declaration=True)
    return target
