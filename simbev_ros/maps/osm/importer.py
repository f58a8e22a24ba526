"""Imports an OpenStreetMap file: takes a .osm file and returns the parts of a map."""

from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
from pyproj import Transformer

from simbev_ros.errors import InputError, SimulationError
from simbev_ros.maps.osm.data import OsmData, read_osm
from simbev_ros.maps.osm.heights import add_heights
from simbev_ros.maps.osm.land import features_of
from simbev_ros.maps.osm.netfile import center_datum, write_roads, write_types
from simbev_ros.maps.osm.road_rules import road_tags
from simbev_ros.maps.osm.roads import join_roads, roads_of
from simbev_ros.maps.parts import MapParts
from simbev_ros.maps.sumo import netconvert

_MAX_EXTENT_M = 30_000.0
_MAX_LENGTH_M = 4e6
_MAX_KEYS = 4
_OPTIONS = (
    "--offset.disable-normalization=true",
    "--osm.sidewalks=true",
    "--osm.crossings=true",
    "--osm.turn-lanes=true",
    "--osm.bike-access=true",
    "--osm.elevation=true",
    "--default.sidewalk-width=2.2",
    "--crossings.guess=true",
    "--crossings.guess.speed-threshold=14",
    "--walkingareas=true",
    "--junctions.join=true",
    "--tls.guess-signals=true",
    "--tls.join=true",
    "--tls.default-type=static",
    "--roundabouts.guess=true",
    "--ramps.guess=true",
    "--no-turnarounds.except-deadend=true",
    "--rectangular-lane-cut=true",
    "--junctions.internal-link-detail=20",
    "--junctions.corner-detail=8",
    "--precision=4",
)


def import_osm(path: Path, work: Path) -> MapParts:
    """Import an OpenStreetMap file.

    Args:
        path: The .osm file.
        work: An empty folder for the resulting files.

    Raises:
        InputError: The file is not OpenStreetMap XML, its content is invalid, or it has no roads for cars.
    """
    data = read_osm(path)
    lines = [np.array(way.nodes) for way in data.ways if road_tags(way.tags) is not None]
    road_nodes = sorted({node for line in lines for node in line.tolist()})
    if not road_nodes:
        raise InputError(f"{path}: has no roads: it is {_contents(data)}, not a street map")
    datum = center_datum(data.longitude_latitude_deg[road_nodes])
    to_map = Transformer.from_crs("EPSG:4326", datum.proj_string, always_xy=True)
    xy_m = np.column_stack(to_map.transform(*data.longitude_latitude_deg.T))
    extent_m = float(np.ptp(xy_m[road_nodes], axis=0).max())
    if not extent_m <= _MAX_EXTENT_M:
        raise InputError(
            f"{path}: its roads span {extent_m / 1000:.0f} km; at most {_MAX_EXTENT_M / 1000:.0f} km are read. "
            "Extract the part that you need"
        )
    length_m = sum(float(np.hypot(*np.diff(xy_m[line], axis=0).T).sum()) for line in lines)
    if length_m > _MAX_LENGTH_M:
        raise InputError(
            f"{path}: its roads are {length_m / 1000:.0f} km long; at most {_MAX_LENGTH_M / 1000:.0f} km are read. "
            "Extract the part that you need"
        )
    roads, road_notes = roads_of(data, xy_m)
    if all(road.way.walk for road in roads):
        raise InputError(f"{path}: has no roads that cars may drive on")
    features, land_notes = features_of(data, xy_m, roads)
    divided, xyz_m, height_notes = add_heights(roads, xy_m)
    raised = join_roads([replace(road, way=road.way.at_grade()) for road in divided])
    source, types = work / "roads.osm", work / "types.typ.xml"
    write_roads(source, raised, xyz_m, data.node_tags, datum)
    write_types(types)
    net, opendrive = work / "map.net.xml", work / "map.xodr"
    options = [f"--osm-files={source}", f"--type-files={types}", f"--proj={datum.proj_string}", *_OPTIONS]
    if data.left_hand:
        options.append("--lefthand=true")
    try:
        netconvert.run_netconvert(options, net, opendrive)
    except SimulationError as error:
        raise InputError(f"{path}: {error}") from None
    notes = (*data.notes, *road_notes, *height_notes, *land_notes)
    return MapParts(net, opendrive, datum, features, notes=notes)


def _contents(data: OsmData) -> str:
    """What a file without roads holds: the most frequent keys of its ways."""
    keys = Counter(key for way in data.ways for key in way.tags)
    if not keys:
        return f"a file of {len(data.longitude_latitude_deg)} points and {len(data.ways)} ways without tags"
    return f"a file of {len(data.ways)} ways with the tags {', '.join(key for key, _ in keys.most_common(_MAX_KEYS))}"
