"""From a SUMO net (.net.xml) of any origin to the parts of a map.

The net is checked, mended and put into the map frame, then goes through netconvert again, which adds what the map needs
and the net may lack: lanes inside junctions, walking areas, crossings, sidewalks.
"""

from pathlib import Path
from xml.etree.ElementTree import Element, ElementTree

import numpy as np
from pyproj import CRS, Transformer
from pyproj.exceptions import ProjError

from simbev_ros.errors import InputError, SimulationError
from simbev_ros.geometry.geodesy import MapDatum
from simbev_ros.maps.land_features import MapFeatures
from simbev_ros.maps.parts import MapParts
from simbev_ros.maps.safe_xml import parse, place_of
from simbev_ros.maps.sumo import netconvert
from simbev_ros.maps.sumo.repair import NetFile
from simbev_ros.maps.surroundings import SurroundingsRecipe
from simbev_ros.types import Float64Array

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
_FAR_M = 20_000.0
_LARGEST_M = 100_000.0
_HIGH_M = 50.0
_EXACT_M = 0.01
_UNKNOWN = MapDatum(0.0, 0.0, 0.0)
_SURROUNDINGS = SurroundingsRecipe(use="residential")


def import_sumo(path: Path, work: Path) -> MapParts:
    """Read a net.

    Args:
        path: The .net.xml file.
        work: An empty folder for the files of the result.

    Raises:
        InputError: The file is no SUMO net, something in it is wrong, or cars can drive nowhere.
    """
    root = parse(path, "net")
    file = NetFile(path, root)
    file.repair()
    notes = [*file.notes]
    datum = _place_in_map_frame(path, root, file, notes)
    options = [*_OPTIONS]
    if not any(_for_walkers(lane) for lane in file.lanes()):
        options += _GUESS_SIDEWALKS
        notes.append("there are no sidewalks: streets of up to 50 km/h were given some")
    if not any(edge.get("function") == "crossing" for edge in root.iter("edge")):
        options += _GUESS_CROSSINGS
        notes.append("there are no crossings: junctions with sidewalks were given some")
    source, net, opendrive = work / "source.net.xml", work / "map.net.xml", work / "map.xodr"
    ElementTree(root).write(source, encoding="utf-8")
    try:
        netconvert.run([f"--sumo-net-file={source}", *options], net, opendrive)
    except SimulationError as error:
        raise InputError(f"{path}: {error}") from None
    return MapParts(net, opendrive, datum, MapFeatures(_SURROUNDINGS), notes=tuple(notes))


def _for_walkers(lane: Element) -> bool:
    """A lane for pedestrians alone, as sidewalks are."""
    return lane.get("allow", "") in ("pedestrian", "pedestrian wheelchair")


def _place_in_map_frame(path: Path, root: Element, file: NetFile, notes: list[str]) -> MapDatum:
    """Move the net's coordinates into a map frame at its own origin, or at its middle where that is far away."""
    location = root.find("location")
    low_m, high_m = file.extent_m()
    extent_m = float((high_m - low_m).max())
    if extent_m > _LARGEST_M:
        raise InputError(
            f"{path}: its edges span {extent_m / 1000:.0f} km; at most {_LARGEST_M / 1000:.0f} km are read. "
            "Cut out the part that is wanted"
        )
    middle_m = np.round((low_m + high_m) / 2.0)
    origin_m = np.where(np.abs(middle_m) > (_FAR_M, _FAR_M, _HIGH_M), middle_m, 0.0)
    if origin_m.any():
        notes.append(f"it lies far from its origin: map (0, 0, 0) is {', '.join(f'{v:.0f}' for v in origin_m)} there")
    projection = _projection(path, location)
    if projection is None or location is None:
        notes.append("it has no projection: GNSS takes its origin for 0° N 0° E")
        file.move(lambda xyz_m: xyz_m - origin_m)
        return _UNKNOWN
    to_geodetic = Transformer.from_crs(projection, "EPSG:4326", always_xy=True)
    offset_m = np.array([*_offset(path, location), 0.0])
    longitude, latitude = to_geodetic.transform(*(origin_m - offset_m)[:2])
    if not (abs(latitude) <= 89.0 and abs(longitude) <= 180.0):
        raise InputError(f"{place_of(path, location)}: location: its projection does not hold at the net's coordinates")
    datum = MapDatum(round(latitude, 9), round(longitude, 9), float(origin_m[2]))
    to_map = Transformer.from_crs(projection, datum.proj_string, always_xy=True)

    def map_from_net(xyz_m: Float64Array) -> Float64Array:
        x_m, y_m = to_map.transform(*(xyz_m - offset_m)[:, :2].T)
        return np.column_stack([x_m, y_m, xyz_m[:, 2] - origin_m[2]])

    corners_m = np.array([low_m, high_m, (low_m[0], high_m[1], 0.0), (high_m[0], low_m[1], 0.0)])
    moved_m = float(np.abs(map_from_net(corners_m) - (corners_m - origin_m))[:, :2].max())
    if moved_m > _EXACT_M:
        notes.append(
            f"its coordinates were turned and scaled so that x points east in metres: by up to {moved_m:.2f} m"
        )
    file.move(map_from_net)
    location.attrib.update(netOffset="0.00,0.00", projParameter=datum.proj_string)
    return datum


def _projection(path: Path, location: Element | None) -> CRS | None:
    """The net's projection; None if it has none that says where on Earth it lies."""
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
        raise InputError(f"{place_of(path, location)}: location: netOffset: must be x,y in metres") from None
    return x_m, y_m
