"""Reads an OpenStreetMap file of any form, or a part of it, and decides on which side its traffic drives."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from simbev_ros.foundation.types import Int64Array
from simbev_ros.maps.findings import Finding, Outcome
from simbev_ros.maps.osm.box import Box
from simbev_ros.maps.osm.data import OsmData
from simbev_ros.maps.osm.driving_side import keeps_left
from simbev_ros.maps.osm.extract import SURROUNDINGS_M, cut
from simbev_ros.maps.osm.pbf import is_pbf, read_pbf
from simbev_ros.maps.osm.road_rules import road_tags
from simbev_ros.maps.osm.xml import read_xml


def read_osm(path: Path, box: Box | None = None) -> OsmData:
    """Read an OpenStreetMap file: XML, plain or compressed, or PBF.

    Args:
        path: The file; its content decides how it is read, not its name.
        box: The part to read; None: all.

    Raises:
        InputError: It is not such a file, it is damaged or too large, or an id or coordinate in it is invalid.
    """
    if is_pbf(path):
        elements, part = read_pbf(path, None if box is None else box.grow(SURROUNDINGS_M))
        data = elements.resolve()
        if box is None and part is not None:
            data = cut(data, part, "it has too many nodes to be read whole")
    else:
        data = read_xml(path).resolve()
    if box is not None:
        data = cut(data, box)
    if data.driving_side:
        return replace(data, left_hand=data.driving_side == "left")
    nodes = road_nodes(data)
    if not len(nodes):
        return data
    # All within 180 degrees of the first, so that the mean of a town at the antimeridian lies in the town.
    degrees = Box(*data.longitude_latitude_deg[nodes[[0, 0]]].ravel()).unwrap(data.longitude_latitude_deg[nodes])
    left_hand = keeps_left(*np.median(degrees, axis=0).tolist())
    side = "left" if left_hand else "right"
    assumed = Finding(f"no tag says on which side traffic drives: it keeps to the {side}, by position", Outcome.ASSUMED)
    return replace(data, left_hand=left_hand, findings=(*data.findings, assumed))


def road_nodes(data: OsmData) -> Int64Array:
    """Sorted indices of the nodes of all roads."""
    lines = [way.nodes for way in data.ways if road_tags(way.tags) is not None]
    return np.unique(np.array([node for line in lines for node in line], np.int64))
