"""Writes a map as OpenStreetMap XML: roads with lanes, speeds, sidewalks and bridges, lights, land, water, buildings.

A carriageway with traffic in both directions is one way along its center line; one with a median is two one-way ways.
What OpenStreetMap has no tags for, exact widths and paint, is not in the file.
"""

from collections.abc import Iterable, Mapping
from itertools import count
from xml.etree.ElementTree import Element, SubElement, tostring

import numpy as np
import shapely

from simbev_ros.export.maps.osm_roads import Carriageway, carriageways_of
from simbev_ros.foundation.geometry.geodesy import MapDatum
from simbev_ros.foundation.tables import load_table
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.osm.data import add_tags

_TABLE = "osm_tags.yaml"
_SAME_POINT_M = 0.01

Member = tuple[str, int, str]
"""Member of a relation: the kind of an element, its id, its role."""


def osm_of(network: RoadNetwork) -> bytes:
    """The content of an OpenStreetMap file of a map, in UTF-8, with negative ids, like data that was never uploaded."""
    file = OsmFile(network.datum)
    junction_nodes = {
        name: file.add_node(junction.center_m, {"highway": "traffic_signals"} if junction.signalised else {})
        for name, junction in network.junctions.items()
    }
    for carriageway in carriageways_of(network):
        _add_road(file, carriageway, junction_nodes)
    _add_land(file, network)
    return file.content()


class OsmFile:
    """The elements of a file, in the order nodes, ways, relations.

    Args:
        datum: Datum of the map frame.
        first_id: For Lanelet2, where nodes have ``local_x`` and ``local_y``: ids of elements start here and are unique;
            smaller ones are the caller's. 0: for street maps.
    """

    def __init__(self, datum: MapDatum, first_id: int = 0) -> None:
        self._datum, self._is_local, self._ids = datum, first_id > 0, count(first_id)
        self._elements: dict[str, list[Element]] = {"node": [], "way": [], "relation": []}
        self._nodes: dict[tuple[float, ...], int] = {}

    def add_node(self, position_m: Float64Array, tags: Mapping[str, str]) -> int:
        """Add a node at (2,) or (3,) meters, map frame; return its id."""
        x, y, z = map(float, (*position_m, 0.0)[:3])
        latitude, longitude, altitude_m = self._datum.geodetic_from_map((x, y, z))
        digits, height_digits = (11, 3) if self._is_local else (9, 2)
        if len(position_m) > 2:
            tags = {"ele": f"{altitude_m:.{height_digits}f}", **tags}
        if self._is_local:
            tags = {"local_x": f"{x:.3f}", "local_y": f"{y:.3f}", **tags}
        return self.add("node", tags, lat=f"{latitude:.{digits}f}", lon=f"{longitude:.{digits}f}")

    def add_line(self, points_m: Float64Array, tags: Mapping[str, str]) -> int:
        """Add a way through (N, 3) points, map frame, that shares nodes with others within 1 cm; return its id."""
        nodes: list[int] = []
        for point_m in np.round(points_m, 3) + 0.0:
            key = tuple(np.round(point_m / _SAME_POINT_M).tolist())
            if key not in self._nodes:
                self._nodes[key] = self.add_node(point_m, {})
            nodes += [self._nodes[key]] if nodes[-1:] != [self._nodes[key]] else []
        return self.add("way", tags, nodes)

    def add(
        self, kind: str, tags: Mapping[str, str], members: Iterable[int | Member] = (), name: int = 0, **attributes: str
    ) -> int:
        """Add a node, a way through nodes or a relation of members; return its id, which is ``name`` if not 0."""
        name = name or (next(self._ids) if self._is_local else -len(self._elements[kind]) - 1)
        element = Element(kind, {"id": str(name), "visible": "true", "version": "1", **attributes})
        for member in members:
            if isinstance(member, int):
                SubElement(element, "nd", ref=str(member))
            else:
                SubElement(element, "member", type=member[0], ref=str(member[1]), role=member[2])
        add_tags(element, tags)
        self._elements[kind].append(element)
        return name

    def add_area(self, area: shapely.Polygon, tags: Mapping[str, str]) -> None:
        """Add an area: a closed way, or a multipolygon if it has holes."""
        outer, *inner = (self._add_ring(ring) for ring in (area.exterior, *area.interiors))
        if not inner:
            self.add("way", tags, outer)
            return
        rings = (("outer", outer), *(("inner", ring) for ring in inner))
        members = [("way", self.add("way", {}, ring), role) for role, ring in rings]
        self.add("relation", {"type": "multipolygon", **tags}, members)

    def content(self) -> bytes:
        """The file as UTF-8."""
        root = Element("osm", version="0.6", generator="simbev_ros", upload="never")
        if self._is_local:
            SubElement(root, "MetaInfo", format_version="1", map_version="1")
        for elements in self._elements.values():
            root.extend(elements)
        return b'<?xml version="1.0" encoding="UTF-8"?>\n' + tostring(root, encoding="utf-8") + b"\n"

    def _add_ring(self, ring: shapely.LinearRing) -> list[int]:
        nodes = [self.add_node(np.array(point), {}) for point in ring.coords[:-1]]
        return [*nodes, nodes[0]]


def _add_road(file: OsmFile, carriageway: Carriageway, junction_nodes: dict[str, int]) -> None:
    """Add a way from junction to junction; dead ends get nodes of their own, shared by the roads that meet there."""
    for end, position_m in zip(carriageway.ends, carriageway.line_m[[0, -1]], strict=True):
        if end not in junction_nodes:
            junction_nodes[end] = file.add_node(position_m, {})
    start, goal = (junction_nodes[end] for end in carriageway.ends)
    inside = [file.add_node(point_m, {}) for point_m in carriageway.line_m]
    file.add("way", carriageway.tags, [start, *inside, goal])


def _add_land(file: OsmFile, network: RoadNetwork) -> None:
    """Add zones, water and prescribed buildings."""
    tags, features = load_table("simbev_ros.export.maps", _TABLE), network.features
    for zone in features.zones:
        file.add_area(zone.area, dict([tags["zones"][zone.surroundings.use].split("=")]))
    for water in features.water:
        file.add_area(water.area, {"natural": "water"})
    for building in features.buildings or ():
        roof = {"roof:shape": building.roof} if building.roof else {}
        height = {"height": f"{building.height_m:.1f}"}
        file.add_area(building.outline, {"building": tags["buildings"].get(building.use, "yes"), **height, **roof})
