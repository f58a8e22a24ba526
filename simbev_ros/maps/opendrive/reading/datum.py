"""Reads the geodetic datum of an OpenDRIVE file from its <geoReference> and <offset>."""

import math
import re
from xml.etree.ElementTree import Element

from pyproj import CRS, Transformer
from pyproj.exceptions import ProjError

from simbev_ros.foundation.geometry.geodesy import MapDatum
from simbev_ros.maps.findings import Findings
from simbev_ros.maps.opendrive.reading.attributes import Malformed, number

_UNKNOWN = MapDatum(0.0, 0.0, 0.0)
_VERTICAL = re.compile(r"\+(?:geoidgrids|vunits|geoid_crs|vto_meter)=\S+")
_SOUTH_ORIENTED = "Transverse Mercator (South Orientated)"
_MAX_LATITUDE_DEG = 89.5


def datum_of(root: Element, notes: Findings) -> MapDatum:
    """The datum of the file's coordinates; 0° N 0° E, with a note, if the file has none.

    Coordinates are first rotated by ``hdg`` and translated by ``x``, ``y``, ``z`` of the header's <offset>, and are
    then those of the projection. Heights are taken as ellipsoidal.
    """
    header = root.find("header")
    reference = None if header is None else header.find("geoReference")
    text = "" if reference is None else " ".join("".join(reference.itertext()).split())
    if header is None or reference is None or not text:
        notes.assumed("it has no geoReference: GNSS uses 0° N 0° E for its origin")
        return _UNKNOWN
    try:
        x_m, y_m, z_m, heading_rad = offset_of(header)
        if text.startswith("+") and "+proj=" not in text and "+lat_0=" in text:
            text = f"+proj=tmerc +datum=WGS84 {text}"  # as CARLA reads it
            notes.assumed("its geoReference names no projection: transverse Mercator is used", reference)
        crs = CRS.from_user_input(_VERTICAL.sub("", text) if text.startswith("+") else text)
        if crs.is_projected and not _is_metric(crs):
            notes.assumed(
                "its geoReference has other units or axes: x and y are taken as meters east and north", reference
            )
            crs = _in_meters(crs)
        if not crs.is_projected and "+proj=" in text and crs.is_geographic:
            raise ProjError("it is not a projection to meters")
        longitude, latitude = Transformer.from_crs(crs, "EPSG:4326", always_xy=True).transform(x_m, y_m)
    except (ProjError, Malformed) as problem:
        notes.assumed(
            "its geoReference cannot be used: GNSS uses 0° N 0° E for its origin", reference, str(problem)[:160]
        )
        return _UNKNOWN
    if not (abs(latitude) <= _MAX_LATITUDE_DEG and abs(longitude) <= 180.0):
        notes.assumed("its geoReference is not valid at its origin: GNSS uses 0° N 0° E", reference)
        return _UNKNOWN
    return _datum(crs, latitude, longitude, (x_m, y_m, z_m, heading_rad))


def _is_metric(crs: CRS) -> bool:
    """Whether the axes of a projection are meters to the east and to the north, as those of OpenDRIVE are."""
    axes = crs.axis_info[:2]
    return {axis.direction for axis in axes} == {"east", "north"} and all(
        axis.unit_conversion_factor == 1.0 for axis in axes
    )


def _in_meters(crs: CRS) -> CRS:
    """The same projection with axes in meters to the east and to the north."""
    described = crs.to_json_dict()
    for axis, direction in zip(described["coordinate_system"]["axis"], ("east", "north"), strict=False):
        axis.update(unit="metre", direction=direction)
    if described["conversion"]["method"]["name"] == _SOUTH_ORIENTED:  # its formulas have the signs, not its axes alone
        described["conversion"]["method"] = {"name": "Transverse Mercator"}
    described.pop("id", None)
    return CRS.from_json_dict(described)


def offset_of(header: Element) -> tuple[float, float, float, float]:
    """x, y, z (m) and hdg (rad) of the header's <offset>; zeros if there is none.

    Raises:
        Malformed: One of them is not a number.
    """
    offset = header.find("offset")
    if offset is None:
        return 0.0, 0.0, 0.0, 0.0
    x_m, y_m, z_m, heading_rad = (number(offset, name, 0.0) for name in ("x", "y", "z", "hdg"))
    return x_m, y_m, z_m, heading_rad


def _datum(crs: CRS, latitude: float, longitude: float, offset: tuple[float, float, float, float]) -> MapDatum:
    """The simplest equivalent datum: without a projection of its own if a plain MapDatum gives the same map frame."""
    x_m, y_m, z_m, heading_rad = offset
    plain = MapDatum(round(latitude, 11), round(longitude, 11), z_m)
    full = MapDatum(plain.latitude_deg, plain.longitude_deg, z_m, crs.to_wkt(), x_m, y_m, heading_rad)
    for corner_m in ((5000.0, 0.0, 0.0), (0.0, 5000.0, 0.0), (-5000.0, -5000.0, 0.0)):
        geodetic = full.geodetic_from_map(corner_m)
        back_m = plain.map_from_geodetic(*geodetic)
        if math.dist(back_m, (corner_m[0], corner_m[1], z_m - z_m)) > 1e-3:
            return full
    return plain
