"""Imports an OpenStreetMap file: takes a file and returns the parts of a map."""

from collections import Counter
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
from pyproj import Transformer

from simbev_ros.config.map_files import Bounds
from simbev_ros.foundation.errors import InputError, SimulationError
from simbev_ros.foundation.files.limits import MAX_MAP_BYTES
from simbev_ros.foundation.geometry.geodesy import MapDatum
from simbev_ros.foundation.process_memory import return_freed_memory
from simbev_ros.foundation.types import Float64Array, Int64Array
from simbev_ros.maps.findings import WALKED_VERGES, Finding, Outcome
from simbev_ros.maps.land_features import MapFeatures
from simbev_ros.maps.lane_graph.verges import VERGE_M
from simbev_ros.maps.osm.box import MAX_SIDE_M, Box, densest_box, sample_segments, segment_lengths_m
from simbev_ros.maps.osm.data import OsmData
from simbev_ros.maps.osm.extract import cut, write_osm
from simbev_ros.maps.osm.heights import add_heights
from simbev_ros.maps.osm.land import features_of
from simbev_ros.maps.osm.netfile import center_datum, write_roads, write_types
from simbev_ros.maps.osm.reader import read_osm, road_nodes
from simbev_ros.maps.osm.road_rules import SIDEWALK_M, road_tags
from simbev_ros.maps.osm.roads import join_roads, roads_of
from simbev_ros.maps.osm.verges import is_marked_crossing, unpaved_layout_of, with_verges
from simbev_ros.maps.parts import MapParts
from simbev_ros.maps.sumo import netconvert
from simbev_ros.maps.sumo.net import read_sumo_net

_MAX_LENGTH_M = 4e6
_MAX_KEYS = 4
_OPTIONS = (
    "--offset.disable-normalization=true",
    "--osm.sidewalks=true",
    "--osm.crossings=true",
    "--osm.turn-lanes=true",
    "--osm.bike-access=true",
    "--osm.elevation=true",
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
_TUNNEL_OPTIONS = ("--osm.all-attributes=true", "--osm.extra-attributes=tunnel")
"""Pass the tag on to the edges of the net."""


def import_osm(path: Path, work: Path, bounds: Bounds | None = None) -> MapParts:
    """Import an OpenStreetMap file.

    Args:
        path: The file: XML, plain or compressed, or PBF.
        work: An empty folder for the resulting files.
        bounds: The part to import; None: all, or the densest part of a file that is too large.

    Raises:
        InputError: The file cannot be read, its content is invalid, or it has no roads for cars.
    """
    prepared = _prepare(path, work, bounds)
    return_freed_memory()  # netconvert needs as much again
    net, opendrive = work / "map.net.xml", work / "map.xodr"
    try:
        netconvert.run_netconvert(prepared.options, net, opendrive)
    except SimulationError as error:
        raise InputError(f"{path}: {error}") from None
    return MapParts(
        net,
        opendrive,
        prepared.datum,
        prepared.features,
        unpaved_layout_of(read_sumo_net(net), prepared.crossings_m) if prepared.has_verges else None,
        findings=prepared.findings,
        extract=prepared.extract,
    )


class _Prepared(NamedTuple):
    """Content of a file that an import needs in addition to netconvert's input."""

    options: list[str]
    datum: MapDatum
    features: MapFeatures
    findings: tuple[Finding, ...]
    extract: Path | None
    has_verges: bool
    crossings_m: Float64Array


def _prepare(path: Path, work: Path, bounds: Bounds | None) -> _Prepared:
    """Read a file and write its roads for netconvert, and an extract if not all of it is read."""
    data = _read(path, bounds)
    nodes = road_nodes(data)
    if not len(nodes):
        where = f": it is {_contents(data)}, not a street map" if bounds is None else " within the bounds"
        raise InputError(f"{path}: has no roads{where}")
    datum, xy_m = _project(data, nodes)
    roads, road_findings = roads_of(data, xy_m)
    if all(road.way.walk for road in roads):
        raise InputError(f"{path}: has no roads that cars may drive on")
    walked = with_verges(roads)
    has_verges, roads = walked != roads, walked
    features, land_findings = features_of(data, xy_m, roads)
    divided, xyz_m, height_findings = add_heights(roads, xy_m)
    raised = join_roads([replace(road, way=road.way.at_grade()) for road in divided])
    source, types = work / "roads.osm", work / "types.typ.xml"
    write_roads(source, raised, xyz_m, data.node_tags, datum)
    write_types(types)
    width_m = VERGE_M if has_verges else SIDEWALK_M
    options = [f"--osm-files={source}", f"--type-files={types}", f"--proj={datum.proj_string}", *_OPTIONS]
    options.append(f"--default.sidewalk-width={width_m}")
    if any(road.way.tunnel for road in raised):
        options += _TUNNEL_OPTIONS
    if data.left_hand:
        options.append("--lefthand=true")
    extract = work / "extract.osm" if data.is_part or path.stat().st_size > MAX_MAP_BYTES else None
    if extract is not None:
        write_osm(extract, data)
    findings = (*data.findings, *road_findings, *height_findings, *land_findings)
    if has_verges:
        findings = (*findings, Finding(WALKED_VERGES, Outcome.ASSUMED))
    crossings_m = xy_m[[node for node, tags in data.node_tags.items() if is_marked_crossing(tags)]]
    return _Prepared(options, datum, features, findings, extract, has_verges, crossings_m)


def _read(path: Path, bounds: Bounds | None) -> OsmData:
    """Read a file or a part of it; of a file that is too large only the densest part."""
    box = None if bounds is None else Box.of_bounds(bounds)
    if box is not None and max(box.size_m) > MAX_SIDE_M:
        size_km = " x ".join(f"{side_m / 1000:.0f}" for side_m in box.size_m)
        raise InputError(f"{path}: bounds: span {size_km} km; at most {MAX_SIDE_M / 1000:.0f} km are read")
    data = read_osm(path, box)
    nodes = road_nodes(data)
    extent_m = float(np.ptp(_project(data, nodes)[1][nodes], axis=0).max()) if len(nodes) else 0.0
    segments = _segments(data)
    length_m = float(segment_lengths_m(*segments).sum())
    if box is None and (extent_m > MAX_SIDE_M or length_m > _MAX_LENGTH_M):
        # Far from its origin the projection is useless, hence the lengths on a sphere.
        box = densest_box(*sample_segments(*segments), _MAX_LENGTH_M)
        reason = (
            f"its roads span {extent_m / 1000:.0f} km and are {length_m / 1000:.0f} km long; at most "
            f"{MAX_SIDE_M / 1000:.0f} km and {_MAX_LENGTH_M / 1000:.0f} km are read"
        )
        data = cut(data, box, reason)
        length_m = float(segment_lengths_m(*_segments(data)).sum())
    if length_m > _MAX_LENGTH_M:
        raise InputError(
            f"{path}: its roads are {length_m / 1000:.0f} km long; at most {_MAX_LENGTH_M / 1000:.0f} km are read. "
            "Choose a smaller part with bounds (west, south, east, north in degrees)"
        )
    return data


def _segments(data: OsmData) -> Float64Array:
    """(2, N, 2) longitudes and latitudes of both ends of all segments of roads."""
    lines = [way.nodes for way in data.ways if road_tags(way.tags) is not None]
    ends = np.array([pair for line in lines for pair in pairwise(line)], np.int64).reshape(-1, 2)
    return data.longitude_latitude_deg[ends.T]


def _project(data: OsmData, nodes: Int64Array) -> tuple[MapDatum, Float64Array]:
    """The datum at the center of the roads' nodes, and (N, 2) positions of all nodes, map frame."""
    datum = center_datum(data.longitude_latitude_deg[nodes])
    to_map = Transformer.from_crs("EPSG:4326", datum.proj_string, always_xy=True)
    return datum, np.column_stack(to_map.transform(*data.longitude_latitude_deg.T))


def _contents(data: OsmData) -> str:
    """Description of a file without roads: the most frequent keys of its ways."""
    keys = Counter(key for way in data.ways for key in way.tags)
    if not keys:
        return f"a file of {len(data.longitude_latitude_deg)} points and {len(data.ways)} ways without tags"
    return f"a file of {len(data.ways)} ways with the tags {', '.join(key for key, _ in keys.most_common(_MAX_KEYS))}"
