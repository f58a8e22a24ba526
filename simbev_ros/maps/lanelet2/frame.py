"""Positions of the points of a Lanelet2 file in the map frame, and the datum of that frame.

Points have latitude and longitude, or coordinates of their own in the tags ``local_x`` and ``local_y``, as Autoware
writes them. Local coordinates are the map frame; their position on Earth follows from latitudes and longitudes, else
from ``map_projector_info.yaml`` next to the file, else from the points' ``mgrs_code``.
"""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np
from pyproj import Transformer

from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.geometry.geodesy import MapDatum
from simbev_ros.foundation.types import BoolArray, Float64Array
from simbev_ros.maps.findings import Findings
from simbev_ros.maps.lanelet2.elements import tags_of
from simbev_ros.maps.lanelet2.projector_info import datum_of_file, datum_of_grid, mercator_plane, utm_plane
from simbev_ros.maps.osm.netfile import center_datum

_MAX_REACH_M = 15_000.0
_MIN_NEAR_FRACTION = 0.99
_DEGREE_M = 111_000.0
_MAX_COORDINATE = 1e8
_MAX_HEIGHT_M = 10_000.0
_MAX_OFFSET_M = 20_000.0
_MAX_LATITUDE_DEG = 84.0
_TOLERANCE_M = 0.5
_UNKNOWN = MapDatum(0.0, 0.0, 0.0)


def map_frame(
    path: Path, nodes: Mapping[str, Element], notes: Findings
) -> tuple[Float64Array, MapDatum, dict[str, int]]:
    """Positions of the points of a file.

    Args:
        path: The file, named in errors.
        nodes: Its <node> elements by id.
        notes: Receives repairs and omissions.

    Returns:
        (N, 3) points in the map frame, the datum of the map frame, and point id → its row; points without a usable
        position are left out.

    Raises:
        InputError: There are no usable points, or they span too far.
    """
    tags = [tags_of(node) for node in nodes.values()]
    local_m = np.array([(_number(each, "local_x"), _number(each, "local_y")) for each in tags]).reshape(-1, 2)
    degrees = np.array([(_number(node, "lon"), _number(node, "lat")) for node in nodes.values()]).reshape(-1, 2)
    height_m = np.array([_number(each, "ele") for each in tags])
    on_earth = np.all(np.abs(degrees) <= [180.0, 90.0], axis=1)
    is_local = np.isfinite(local_m).all(axis=1)
    has_frame = bool(is_local[is_local | on_earth].all())
    usable = (is_local if has_frame else on_earth) & ~(np.abs(height_m) > _MAX_HEIGHT_M)
    if not usable.any():
        raise InputError(f"{path}: its points have neither latitude and longitude nor local_x and local_y")
    if has_frame:
        usable = _near(path, local_m, usable, 1.0)
        grids = {each["mgrs_code"] for each in tags if "mgrs_code" in each}
        datum = _local_datum(path, local_m[usable], degrees[usable], on_earth[usable], grids, notes)
        xy_m, datum = _recentered(local_m[usable], datum, notes)
        datum = _with_own_origin(datum)
        height_m = height_m - datum.altitude_m
    else:
        usable = _near(path, degrees, usable, _DEGREE_M)
        datum = center_datum(degrees[usable])
        to_map = Transformer.from_crs("EPSG:4326", datum.proj_string, always_xy=True)
        xy_m = np.column_stack(to_map.transform(*degrees[usable].T))
    for node in [node for node, use in zip(nodes.values(), usable.tolist(), strict=True) if not use]:
        notes.left_out("a point without a usable position is left out", node, f"node {node.get('id')}")
    height_m = height_m[usable]
    if np.isnan(height_m).any():
        notes.repaired(f"{int(np.isnan(height_m).sum())} points have no elevation (ele): they lie at 0 m")
    known = (name for name, use in zip(nodes, usable.tolist(), strict=True) if use)
    return np.column_stack([xy_m, np.nan_to_num(height_m)]), datum, {name: row for row, name in enumerate(known)}


def _near(path: Path, positions: Float64Array, usable: BoolArray, unit_m: float) -> BoolArray:
    """(N,) whether points are usable and near most others.

    Raises:
        InputError: More than a hundredth of the usable points are too far from the others, and thus not just errors.
    """
    gaps_m = np.abs(positions - np.median(positions[usable], axis=0)).max(axis=1) * unit_m
    near = usable & (gaps_m <= _MAX_REACH_M)
    if near.sum() < _MIN_NEAR_FRACTION * usable.sum():
        raise InputError(
            f"{path}: its points lie up to {gaps_m[usable].max() / 1000:.0f} km from its middle; at most "
            f"{_MAX_REACH_M / 1000:.0f} km are read. Extract the part that you need"
        )
    return np.asarray(near)


def _number(values: Element | Mapping[str, str], name: str) -> float:
    """An attribute or tag as a finite number, else NaN."""
    try:
        value = float(values.get(name) or "nan")
    except ValueError:
        return np.nan
    return value if abs(value) <= _MAX_COORDINATE else np.nan


def _local_datum(
    path: Path, local_m: Float64Array, degrees: Float64Array, on_earth: BoolArray, grids: set[str], notes: Findings
) -> MapDatum:
    """The datum of local coordinates."""
    stated = datum_of_file(path)
    if on_earth.all() and np.ptp(degrees, axis=0).max() > 0.0:
        if stated is not None and not stated.projection:
            to_map = Transformer.from_crs("EPSG:4326", stated.proj_string, always_xy=True)
            if np.abs(np.column_stack(to_map.transform(*degrees.T)) - local_m).max() < _TOLERANCE_M:
                return stated
        datum = _fitted_datum(local_m, degrees)
        if datum is not None:
            return datum
        notes.left_out("latitudes and longitudes contradict local_x and local_y, and are ignored")
    datum = stated or (datum_of_grid(grids.pop()) if len(grids) == 1 else None)
    if datum is None:
        notes.assumed("its local coordinates have no position on Earth: GNSS uses 0° N 0° E for their origin")
    return datum or _UNKNOWN


def _fitted_datum(local_m: Float64Array, degrees: Float64Array) -> MapDatum | None:
    """The datum that takes local coordinates to their latitudes and longitudes; None if no projection does.

    Autoware's coordinates are those of UTM, shifted. All others are taken as a rotated plane at the center of the map.
    """
    if np.abs(degrees[:, 1]).max() < _MAX_LATITUDE_DEG:
        utm = utm_plane(float(np.median(degrees[:, 0])))
        shift_m = (
            np.column_stack(Transformer.from_crs("EPSG:4326", utm, always_xy=True).transform(*degrees.T)) - local_m
        )
        middle_m = np.median(shift_m, axis=0)
        agrees = np.abs(shift_m - middle_m).max(axis=1) < _TOLERANCE_M
        if agrees.mean() >= _MIN_NEAR_FRACTION:
            return _at_origin(MapDatum(0.0, 0.0, 0.0, utm, *np.round(middle_m, 2).tolist()))
    center = center_datum(degrees)
    plane = mercator_plane(center.latitude_deg, center.longitude_deg, 1.0)
    east_m, north_m = Transformer.from_crs("EPSG:4326", plane, always_xy=True).transform(*degrees.T)
    target, source = east_m + 1j * north_m, local_m @ np.array([1.0, 1j])
    turn = np.vdot(source - source.mean(), target - target.mean())
    turn /= max(abs(turn), 1e-9)
    offset = target.mean() - turn * source.mean()
    if np.abs(offset + turn * source - target).max() > max(_TOLERANCE_M, 1e-3 * float(np.ptp(local_m, axis=0).max())):
        return None
    return _at_origin(MapDatum(0.0, 0.0, 0.0, plane, offset.real, offset.imag, float(np.angle(turn))))


def _at_origin(datum: MapDatum) -> MapDatum:
    """The datum with the latitude and longitude of its origin filled in."""
    latitude, longitude, _ = datum.geodetic_from_map((0.0, 0.0, 0.0))
    return replace(datum, latitude_deg=round(latitude, 11), longitude_deg=round(longitude, 11))


def _recentered(xy_m: Float64Array, datum: MapDatum, notes: Findings) -> tuple[Float64Array, MapDatum]:
    """Coordinates far from their origin are shifted to the middle of the map, and the datum with them."""
    middle_m = np.round(np.median(xy_m, axis=0))
    if np.abs(middle_m).max() <= _MAX_OFFSET_M:
        return xy_m, datum
    notes.assumed(f"it lies far from its origin: map (0, 0) is its ({middle_m[0]:.0f}, {middle_m[1]:.0f})")
    if datum != _UNKNOWN:
        if not datum.projection:
            datum = replace(datum, projection=mercator_plane(datum.latitude_deg, datum.longitude_deg, 1.0))
        shift = complex(*middle_m.tolist()) * np.exp(1j * datum.heading_rad)
        east_m, north_m = datum.false_easting_m + shift.real, datum.false_northing_m + shift.imag
        datum = _at_origin(replace(datum, false_easting_m=east_m, false_northing_m=north_m))
    return xy_m - middle_m, datum


def _with_own_origin(datum: MapDatum) -> MapDatum:
    """The same datum with its offset as a part of the projection, so that this alone describes the map frame."""
    if not datum.projection or datum.heading_rad:
        return datum
    offset = f"+x_0={-float(datum.false_easting_m)!r} +y_0={-float(datum.false_northing_m)!r} +datum"
    projection = datum.projection.replace("+datum", offset)
    return replace(datum, projection=projection, false_easting_m=0.0, false_northing_m=0.0)
