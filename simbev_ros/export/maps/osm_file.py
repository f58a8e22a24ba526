"""Writes a map as OpenStreetMap XML: roads with lanes, speeds, sidewalks and bridges, lights, land, water, buildings.

A carriageway with traffic in both directions is one way along its center line; one with a median is two one-way ways.
What OpenStreetMap has no tags for, exact widths and paint, is not in the file.
"""

from collections.abc import Mapping, Sequence
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


def osm_of(network: RoadNetwork) -> bytes:
    """The content of an OpenStreetMap file of a map, in UTF-8, with negative ids, like data that was never uploaded."""
    file = _OsmFile(network.datum)
    junction_nodes = {
        name: file.add_node(junction.center_m, {"highway": "traffic_signals"} if junction.signalised else {})
        for name, junction in network.junctions.items()
    }
    for carriageway in carriageways_of(network):
        _add_road(file, carriageway, junction_nodes)
    _add_land(file, network)
    return file.content()


class _OsmFile:
    """The elements of a file, in the order nodes, ways, relations."""

    def __init__(self, datum: MapDatum) -> None:
        self._datum = datum
        self._nodes: list[Element] = []
        self._ways: list[Element] = []
        self._relations: list[Element] = []

    def add_node(self, position_m: Float64Array, tags: Mapping[str, str]) -> int:
        """Add a node at (2,) or (3,) meters, map frame; return its id."""
        height_m = float(position_m[2]) if len(position_m) > 2 else 0.0
        latitude, longitude, altitude_m = self._datum.geodetic_from_map((*map(float, position_m[:2]), height_m))
        attributes = {"id": str(-len(self._nodes) - 1), "visible": "true", "version": "1"}
        node = Element("node", {**attributes, "lat": f"{latitude:.9f}", "lon": f"{longitude:.9f}"})
        add_tags(node, {**({"ele": f"{altitude_m:.2f}"} if len(position_m) > 2 else {}), **tags})
        self._nodes.append(node)
        return -len(self._nodes)

    def add_way(self, nodes: Sequence[int], tags: Mapping[str, str]) -> int:
        """Add a way through nodes; return its id."""
        way = Element("way", {"id": str(-len(self._ways) - 1), "visible": "true", "version": "1"})
        for node in nodes:
            SubElement(way, "nd", ref=str(node))
        add_tags(way, tags)
        self._ways.append(way)
        return -len(self._ways)

    def add_area(self, area: shapely.Polygon, tags: Mapping[str, str]) -> None:
        """Add an area: a closed way, or a multipolygon if it has holes."""
        outer, *inner = (self._add_ring(ring) for ring in (area.exterior, *area.interiors))
        if not inner:
            self.add_way(outer, tags)
            return
        attributes = {"id": str(-len(self._relations) - 1), "visible": "true", "version": "1"}
        relation = Element("relation", attributes)
        for role, ring in (("outer", outer), *(("inner", ring) for ring in inner)):
            SubElement(relation, "member", type="way", ref=str(self.add_way(ring, {})), role=role)
        add_tags(relation, {"type": "multipolygon", **tags})
        self._relations.append(relation)

    def content(self) -> bytes:
        """The file as UTF-8."""
        root = Element("osm", version="0.6", generator="simbev_ros", upload="never")
        root.extend((*self._nodes, *self._ways, *self._relations))
        return b'<?xml version="1.0" encoding="UTF-8"?>\n' + tostring(root, encoding="utf-8") + b"\n"

    def _add_ring(self, ring: shapely.LinearRing) -> list[int]:
        nodes = [self.add_node(np.array(point), {}) for point in ring.coords[:-1]]
        return [*nodes, nodes[0]]


def _add_road(file: _OsmFile, carriageway: Carriageway, junction_nodes: dict[str, int]) -> None:
    """Add a way from junction to junction; dead ends get nodes of their own, shared by the roads that meet there."""
    for end, position_m in zip(carriageway.ends, carriageway.line_m[[0, -1]], strict=True):
        if end not in junction_nodes:
            junction_nodes[end] = file.add_node(position_m, {})
    start, goal = (junction_nodes[end] for end in carriageway.ends)
    inside = [file.add_node(point_m, {}) for point_m in carriageway.line_m]
    file.add_way([start, *inside, goal], carriageway.tags)


def _add_land(file: _OsmFile, network: RoadNetwork) -> None:
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
