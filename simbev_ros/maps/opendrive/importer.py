"""From an OpenDRIVE file to the parts of a map.

The layout is read from the file itself, by its geometry; the traffic net is made from the same lanes, so that vehicles
drive where lanes lie.
"""

import re
from collections import defaultdict
from collections.abc import Iterable, Mapping
from pathlib import Path
from xml.etree.ElementTree import ElementTree

from simbev_ros.errors import InputError, SimulationError
from simbev_ros.maps.opendrive.lane_shapes import lane_shapes
from simbev_ros.maps.opendrive.links import LaneLinks
from simbev_ros.maps.opendrive.objects import crosswalks_of, stop_lines_of
from simbev_ros.maps.opendrive.reading.attributes import Notes
from simbev_ros.maps.opendrive.reading.datum import datum_of
from simbev_ros.maps.opendrive.reading.document import Document
from simbev_ros.maps.opendrive.reading.reader import read_document
from simbev_ros.maps.opendrive.reading.recentering import recentre
from simbev_ros.maps.opendrive.roadside import Carriageway, signal_places_of, signs_of
from simbev_ros.maps.opendrive.signals import Signal, read_signals
from simbev_ros.maps.opendrive.stop_lines import implied_stop_lines, signalled_stop_lines
from simbev_ros.maps.opendrive.strips import strips_of
from simbev_ros.maps.opendrive.surroundings import features_of
from simbev_ros.maps.opendrive.traffic.approaches import Approaches
from simbev_ros.maps.opendrive.traffic.crossings import crosswalks_of_net, planned_crossings
from simbev_ros.maps.opendrive.traffic.sumo_xml import RightOfWay, build_net
from simbev_ros.maps.opendrive.traffic.traffic import Traffic, traffic_of
from simbev_ros.maps.parts import MapParts
from simbev_ros.maps.roads.layout import Layout
from simbev_ros.maps.safe_xml import parse, place_of


def import_opendrive(path: Path, work: Path) -> MapParts:
    """Read a file.

    Args:
        path: The .xodr file.
        work: An empty folder for the files of the result.

    Raises:
        InputError: The file is no OpenDRIVE, or has no lane that can be driven on.
    """
    notes = Notes(path)
    root = parse(path, "OpenDRIVE")
    moved = recentre(root, notes)
    document = read_document(path, root, notes)
    links = LaneLinks(document)
    shapes = {shape.key: shape for shape in lane_shapes(document, notes)}
    strips = strips_of(document, shapes, links, notes)
    traffic = traffic_of(document, shapes, links, notes)
    if not traffic.is_drivable:
        reasons = "".join(f"; {sentence}" for sentence in notes.sentences()[:3])
        raise InputError(f"{place_of(path, root)}: it has no lane that can be driven on{reasons}")
    approaches = Approaches(document, shapes, links)
    signals = read_signals(document, notes)
    crosswalks = crosswalks_of(document, notes)
    stop_lines = (*stop_lines_of(document, notes), *signalled_stop_lines(signals))
    left_hand = _left_hand(document)
    edges, lit = _marked_edges(signals, approaches, traffic)
    crossings = planned_crossings(crosswalks, traffic, lit, left_hand)
    right_of_way = RightOfWay(lit, edges["yield"], edges["stop"], crossings)
    try:
        net = build_net(traffic, right_of_way, left_hand, work)
    except SimulationError as error:
        raise InputError(f"{path}: {error}") from None
    carriageway, lane_ids = Carriageway(strips), traffic.lane_ids()
    layout = Layout(
        strips=strips,
        crosswalks=crosswalks or crosswalks_of_net(net),
        stop_lines=(*stop_lines, *implied_stop_lines(signals, approaches, shapes, stop_lines)),
        signs=signs_of(signals, approaches, lane_ids, carriageway, notes),
        signal_places=signal_places_of(signals, approaches, lane_ids, carriageway, notes),
    )
    datum = datum_of(root, notes)
    opendrive = _write(path, document, moved, work)
    return MapParts(net, opendrive, datum, features_of(strips), layout, notes.sentences())


def _marked_edges(
    signals: Iterable[Signal], approaches: Approaches, traffic: Traffic
) -> tuple[Mapping[str, set[str]], set[str]]:
    """Meaning of signals → edges at whose end they are in force; and the nodes with traffic lights."""
    lane_ids = traffic.lane_ids()
    marked: dict[str, set[str]] = defaultdict(set)
    for signal in signals:
        for key in approaches.of(signal.lanes):
            marked[signal.meaning].update(lane_id.rsplit("_", 1)[0] for lane_id in lane_ids.get(key, ())[-1:])
    return marked, {edge.end for edge in traffic.edges if edge.id in marked["traffic_light"]}


def _left_hand(document: Document) -> bool:
    """Whether traffic keeps to the left on most roads."""
    return sum(road.length_m * (1.0 if road.left_hand else -1.0) for road in document.roads.values()) > 0.0


def _write(path: Path, document: Document, moved: bool, work: Path) -> Path:
    """The file as UTF-8: as it is, if it is UTF-8 and was not moved."""
    target = work / "map.xodr"
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        text = ""
    declared = re.match(r"""\s*<\?xml[^>]*encoding=["']([^"']+)""", text)
    if text and not moved and (declared is None or declared[1].upper() in ("UTF-8", "US-ASCII", "ASCII")):
        target.write_text(text, encoding="utf-8")
    else:
        ElementTree(document.root).write(target, encoding="utf-8", xml_declaration=True)
    return target
