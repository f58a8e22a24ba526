"""Reads Autoware's map_projector_info.yaml, and the names of squares of the Military Grid Reference System (MGRS)."""

import re
from pathlib import Path
from typing import Any

from pyproj import Transformer

from simbev_ros.config.yaml_file import YamlFile
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.geometry.geodesy import MapDatum

FILE_NAME = "map_projector_info.yaml"
_SQUARE = re.compile(r"(\d{1,2})([C-HJ-NP-X])([A-HJ-NP-Z])([A-HJ-NP-V])")
_COLUMNS = ("STUVWXYZ", "ABCDEFGH", "JKLMNPQR")
_ROWS = "ABCDEFGHJKLMNPQRSTUV"
_BANDS = "CDEFGHJKLMNPQRSTUVWX"
_SQUARE_M = 100e3
_ROWS_PERIOD_M = 2e6
UTM_SCALE = 0.9996
"""Scale of UTM on its central meridian."""
_UTM_EAST_M = 500e3
_UTM_SOUTH_M = 10e6  # false northing of the southern hemisphere: a multiple of the period of rows
_ORIGIN = {"latitude": 90.0, "longitude": 180.0, "altitude": 10e3}


def datum_of_file(path: Path) -> MapDatum | None:
    """The datum according to the projector file next to a map; None if there is none or it has no position on Earth.

    Raises:
        InputError: The projector file is invalid.
    """
    file = path.parent / FILE_NAME
    if not file.is_file():
        return None
    data = YamlFile(file).data
    kind = str(data.get("projector_type", "")) if isinstance(data, dict) else ""
    if kind.lower() == "local":
        return None
    if kind == "MGRS":
        datum = datum_of_grid(str(data.get("mgrs_grid", "")))
        if datum is None:
            raise InputError(f"{file}: mgrs_grid: must be a square such as 54SUE, not {data.get('mgrs_grid')!r:.40}")
        return datum
    if kind not in ("LocalCartesian", "LocalCartesianUTM", "TransverseMercator"):
        raise InputError(
            f"{file}: projector_type: must be one of MGRS, LocalCartesianUTM, LocalCartesian, TransverseMercator, "
            f"Local, not {kind!r:.40}"
        )
    latitude, longitude, altitude_m = (_origin(file, data, name) for name in _ORIGIN)
    return datum_of_origin(kind, latitude, longitude, altitude_m)


def datum_of_origin(kind: str, latitude: float, longitude: float, altitude_m: float) -> MapDatum:
    """The datum of a projector with an origin: LocalCartesian, LocalCartesianUTM or TransverseMercator."""
    if kind == "LocalCartesian":
        return MapDatum(latitude, longitude, altitude_m)
    if kind == "TransverseMercator":
        return MapDatum(latitude, longitude, 0.0, mercator_plane(latitude, longitude, UTM_SCALE))
    utm = utm_plane(longitude)
    return MapDatum(latitude, longitude, 0.0, utm, *_projected_m(utm, longitude, latitude))


def datum_of_grid(grid: str) -> MapDatum | None:
    """The datum of coordinates that start at the southwest corner of an MGRS square such as 54SUE; None if it is none.

    Rows of squares repeat every 2,000 km; the band of latitude decides between them (NGA.STND.0037, appendix B).
    """
    match = _SQUARE.match(grid.upper())
    if match is None or not 1 <= int(match[1]) <= 60 or match[3] not in _COLUMNS[int(match[1]) % 3]:
        return None
    zone = int(match[1])
    south_deg = -80.0 + 8.0 * _BANDS.index(match[2])
    utm = utm_plane(6.0 * zone - 183.0)
    lowest_m = _projected_m(utm, 6.0 * zone - 183.0, south_deg)[1]
    east_m = (_COLUMNS[zone % 3].index(match[3]) + 1) * _SQUARE_M - _UTM_EAST_M
    north_m = (_ROWS.index(match[4]) - (0 if zone % 2 else 5)) % len(_ROWS) * _SQUARE_M - _UTM_SOUTH_M
    while north_m + _SQUARE_M <= lowest_m:
        north_m += _ROWS_PERIOD_M
    longitude, latitude = Transformer.from_crs(utm, "EPSG:4326", always_xy=True).transform(east_m, north_m)
    return MapDatum(round(latitude, 11), round(longitude, 11), 0.0, utm, east_m, north_m)


def utm_plane(longitude_deg: float) -> str:
    """PROJ string of the UTM zone of a longitude, with its origin where the central meridian meets the equator."""
    return mercator_plane(0.0, (longitude_deg + 180.0) // 6.0 % 60.0 * 6.0 - 177.0, UTM_SCALE)


def mercator_plane(latitude_deg: float, longitude_deg: float, scale: float) -> str:
    """PROJ string of a transverse Mercator plane with its origin at a position."""
    return f"+proj=tmerc +lat_0={latitude_deg!r} +lon_0={longitude_deg!r} +k={scale!r} +datum=WGS84 +units=m +no_defs"


def _projected_m(projection: str, longitude_deg: float, latitude_deg: float) -> tuple[float, float]:
    east_m, north_m = Transformer.from_crs("EPSG:4326", projection, always_xy=True).transform(
        longitude_deg, latitude_deg
    )
    return float(east_m), float(north_m)


def _origin(file: Path, data: dict[str, Any], name: str) -> float:
    """One number of ``map_origin``."""
    origin = data.get("map_origin")
    value = origin.get(name, 0.0 if name == "altitude" else None) if isinstance(origin, dict) else None
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= _ORIGIN[name]:
        raise InputError(f"{file}: map_origin.{name}: must be a number of at most {_ORIGIN[name]:g}, not {value!r:.40}")
    return float(value)
