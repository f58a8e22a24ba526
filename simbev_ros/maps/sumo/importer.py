"""Imports a SUMO net (.net.xml) of any origin: takes the file and returns the parts of a map.

The net is checked, repaired and transformed to the map frame. Then netconvert adds what the map needs and the net may
lack: lanes inside junctions, walking areas, crossings, sidewalks.
"""

from pathlib import Path
from xml.etree.ElementTree import Element, ElementTree

import numpy as np
from pyproj import CRS, Transformer
from pyproj.exceptions import ProjError

from simbev_ros.foundation.errors import InputError, SimulationError
from simbev_ros.foundation.geometry.geodesy import MapDatum
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.land_features import MapFeatures
from simbev_ros.maps.parts import MapParts
from simbev_ros.maps.safe_xml import parse, place_of
from simbev_ros.maps.sumo import netconvert
from simbev_ros.maps.sumo.repair import NetFile
from simbev_ros.maps.surroundings import SurroundingsRecipe

_OPTIONS = (
    "--walkingareas=true",
    "--no-turnarounds.except-deadend=true",
    "--rectangular-lane-cut=true",
    "--offset.disable-normalization=true",
    "--junctions.internal-link-detail=20",
    "--junctions.corner-detail=8",
    "--precision=4",
)
_GUESS_SIDEWALKS = ("--sidewalks.guess=true", "--sidewalks.guess.min-speed=1", "--sidewalks.guess.max-speed=14")
_GUESS_CROSSINGS = ("--crossings.guess=true", "--crossings.guess.speed-threshold=14")
_MIN_WALKED_M = 20.0  # with sidewalks that are shorter in all, a net has none
_MAX_OFFSET_M = 20_000.0
_MAX_EXTENT_M = 100_000.0
_MAX_HEIGHT_OFFSET_M = 50.0
_DISTORTION_TOLERANCE_M = 0.01
_UNKNOWN = MapDatum(0.0, 0.0, 0.0)
_SURROUNDINGS = SurroundingsRecipe(use="residential")


def import_sumo(path: Path, work: Path) -> MapParts:
    """Import a SUMO net.

    Args:
        path: The .net.xml file.
        work: An empty folder for the resulting files.

    Raises:
        InputError: The file is not a SUMO net, its content is invalid, or it has no lanes for cars.
    """
    root = parse(path, "net")
    file = NetFile(path, root)
    file.repair()
    datum, origin_m = _transform_to_map_frame(path, root, file)
    options = [*_OPTIONS]
    if sum(float(lane.get("length", 0.0)) for lane in file.lanes() if _is_for_pedestrians(lane)) < _MIN_WALKED_M:
        options += _GUESS_SIDEWALKS
        file.findings.assumed("there are no sidewalks: sidewalks were added to streets of up to 50 km/h")
    if not any(edge.get("function") == "crossing" for edge in root.iter("edge")):
        options += _GUESS_CROSSINGS
        file.findings.assumed("there are no crossings: crossings were added to junctions with sidewalks")
    source, net, opendrive = work / "source.net.xml", work / "map.net.xml", work / "map.xodr"
    ElementTree(root).write(source, encoding="utf-8")
    try:
        netconvert.run_netconvert([f"--sumo-net-file={source}", *options], net, opendrive)
    except SimulationError as error:
        raise InputError(f"{path}: {error}") from None
    return MapParts(net, opendrive, datum, MapFeatures(_SURROUNDINGS), findings=file.findings.all(), origin_m=origin_m)


def _is_for_pedestrians(lane: Element) -> bool:
    """Whether a lane is for pedestrians only, as sidewalks are."""
    return lane.get("allow", "") in ("pedestrian", "pedestrian wheelchair")


def _transform_to_map_frame(path: Path, root: Element, file: NetFile) -> tuple[MapDatum, tuple[float, float, float]]:
    """Transform the net's coordinates to a map frame at its own origin, or at its middle if that is far away.

    Returns the datum and that origin in the net's coordinates.
    """
    location = root.find("location")
    low_m, high_m = file.extent_m()
    extent_m = float((high_m - low_m).max())
    if extent_m > _MAX_EXTENT_M:
        raise InputError(
            f"{path}: its edges span {extent_m / 1000:.0f} km; at most {_MAX_EXTENT_M / 1000:.0f} km are read. "
            "Extract the part that you need"
        )
    middle_m = np.round((low_m + high_m) / 2.0)
    origin_m = np.where(np.abs(middle_m) > (_MAX_OFFSET_M, _MAX_OFFSET_M, _MAX_HEIGHT_OFFSET_M), middle_m, 0.0)
    if origin_m.any():
        origin = ", ".join(f"{value:.0f}" for value in origin_m)
        file.findings.assumed(f"it lies far from its origin: map (0, 0, 0) is {origin} there")
    projection = _projection(path, location)
    if projection is None or location is None:
        file.findings.assumed("it has no projection: GNSS uses 0° N 0° E for its origin")
        file.transform(lambda xyz_m: xyz_m - origin_m)
        return _UNKNOWN, tuple(origin_m.tolist())
    to_geodetic = Transformer.from_crs(projection, "EPSG:4326", always_xy=True)
    offset_m = np.array([*_offset(path, location), 0.0])
    longitude, latitude = to_geodetic.transform(*(origin_m - offset_m)[:2])
    if not (abs(latitude) <= 89.0 and abs(longitude) <= 180.0):
        raise InputError(f"{place_of(path, location)}: location: its projection is not valid at the net's coordinates")
    datum = MapDatum(round(latitude, 9), round(longitude, 9), float(origin_m[2]))
    to_map = Transformer.from_crs(projection, datum.proj_string, always_xy=True)

    def map_from_net(xyz_m: Float64Array) -> Float64Array:
        x_m, y_m = to_map.transform(*(xyz_m - offset_m)[:, :2].T)
        return np.column_stack([x_m, y_m, xyz_m[:, 2] - origin_m[2]])

    corners_m = np.array([low_m, high_m, (low_m[0], high_m[1], 0.0), (high_m[0], low_m[1], 0.0)])
    distortion_m = float(np.abs(map_from_net(corners_m) - (corners_m - origin_m))[:, :2].max())
    if distortion_m > _DISTORTION_TOLERANCE_M:
        file.findings.repaired(
            "its coordinates are rotated and scaled so that x points east in meters", None, f"by {distortion_m:.2f} m"
        )
    file.transform(map_from_net)
    location.attrib.update(netOffset="0.00,0.00", projParameter=datum.proj_string)
    return datum, tuple(origin_m.tolist())


def _projection(path: Path, location: Element | None) -> CRS | None:
    """The net's projection; None if it has none that defines its position on Earth."""
    text = "!" if location is None else location.get("projParameter", "!")
    if not text.startswith("+"):
        return None
    try:
        return CRS.from_proj4(text)
    except ProjError:
        assert location is not None
        raise InputError(
            f"{place_of(path, location)}: location: projParameter: not a projection: {text!r:.120}"
        ) from None


def _offset(path: Path, location: Element) -> tuple[float, float]:
    try:
        x_m, y_m = map(float, location.get("netOffset", "0,0").split(","))
    except ValueError:
        raise InputError(f"{place_of(path, location)}: location: netOffset: must be x,y in meters") from None
    return x_m, y_m
