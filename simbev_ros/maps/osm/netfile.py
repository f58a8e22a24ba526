"""Writes cleaned OpenStreetMap roads with heights as OSM XML for netconvert, and the type file that goes with it."""

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from xml.etree.ElementTree import Element, ElementTree, SubElement

import numpy as np

from simbev_ros.foundation.geometry.geodesy import MapDatum
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.osm.data import Tags, add_tags
from simbev_ros.maps.osm.road_rules import RoadRule, road_rules
from simbev_ros.maps.osm.roads import OsmRoad

_NOT_ON_ROADS = (
    "pedestrian tram rail_urban rail rail_electric rail_fast ship container cable_car subway aircraft wheelchair "
    "scooter drone"
)
_NODE_KINDS = ("traffic_signals", "crossing")
_BICYCLE_LANE_M = 1.6
_NODE_SEPARATION_M = 0.03
"""Offset between nodes of roads that cross at two levels, because netconvert merges nodes at the same position."""


def write_roads(
    path: Path,
    roads: Sequence[OsmRoad],
    xyz_m: Float64Array,
    node_tags: Mapping[int, Tags],
    datum: MapDatum,
) -> None:
    """Write the roads as OSM XML; way k + 1 is road k.

    Args:
        path: The file to write.
        roads: The roads.
        xyz_m: (N, 3) nodes, map frame.
        node_tags: Tags by node index.
        datum: Datum of the map frame.
    """
    root = Element("osm", version="0.6")
    used = sorted({node for road in roads for node in road.nodes})
    occupied = Counter[tuple[float, float]]()
    for node in used:
        x_m, y_m, _ = np.round(xyz_m[node], 2)
        offset_m = _NODE_SEPARATION_M * occupied[x_m, y_m]
        occupied[x_m, y_m] += 1
        latitude, longitude, altitude_m = datum.geodetic_from_map(xyz_m[node] + np.array([offset_m, 0.0, 0.0]))
        attributes = {"id": str(node + 1), "lat": f"{latitude:.10f}", "lon": f"{longitude:.10f}"}
        element = SubElement(root, "node", attributes)
        add_tags(element, {"ele": f"{altitude_m - datum.altitude_m:.3f}"})
        tags = node_tags.get(node, {})
        if tags.get("highway") in _NODE_KINDS:
            add_tags(element, {key: tags[key] for key in ("highway", "crossing") if key in tags})
    for index, road in enumerate(roads):
        way = SubElement(root, "way", id=str(index + 1))
        for node in road.nodes:
            SubElement(way, "nd", ref=str(node + 1))
        add_tags(way, road.way.tags)
    ElementTree(root).write(path, encoding="utf-8")


def write_types(path: Path) -> None:
    """Write netconvert's type file: its defaults for each class of roads."""
    root = Element("types")
    for kind, rule in road_rules().items():
        SubElement(root, "type", {"id": f"highway.{kind}", **_type_attributes(rule)})
    bicycle_lane = {"bikeLaneWidth": f"{_BICYCLE_LANE_M}", "allow": "bicycle"}
    for side in ("lane", "opposite_lane"):
        SubElement(root, "type", {"id": f"cycleway.{side}", **bicycle_lane})
    ElementTree(root).write(path, encoding="utf-8")


def _type_attributes(rule: RoadRule) -> dict[str, str]:
    common = {"numLanes": "1", "speed": f"{rule.speed_kmh / 3.6:.2f}", "priority": str(rule.priority)}
    if rule.walk:
        return {**common, "oneway": "true", "width": "2", "allow": "pedestrian"}
    forbidden = _NOT_ON_ROADS if rule.bicycles else f"{_NOT_ON_ROADS} bicycle moped"
    return {**common, "oneway": "true" if rule.one_way else "false", "disallow": forbidden}


def center_datum(longitude_latitude_deg: Float64Array) -> MapDatum:
    """A datum at the center of (N, 2) longitudes and latitudes, rounded to few digits."""
    first_deg = longitude_latitude_deg[0, 0]
    degrees = longitude_latitude_deg.copy()
    # From -180 to 180 degrees east of the first, so that a town may lie on both sides of the antimeridian.
    degrees[:, 0] = (degrees[:, 0] - first_deg + 180.0) % 360.0 - 180.0
    longitude, latitude = (degrees.min(axis=0) + degrees.max(axis=0)) / 2.0
    longitude = (longitude + first_deg + 180.0) % 360.0 - 180.0
    return MapDatum(round(float(latitude), 6), round(float(longitude), 6), 0.0)
