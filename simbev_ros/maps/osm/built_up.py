"""Finds the built-up land of an OpenStreetMap file from its buildings and streets, for land without a mapped use."""

from collections.abc import Iterator, Sequence

import numpy as np
import shapely
from scipy.ndimage import uniform_filter
from shapely.geometry.base import BaseGeometry

from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.types import AnyArray, BoolArray, Float64Array
from simbev_ros.maps.land_features import Footprint, Zone
from simbev_ros.maps.osm.areas import polygons
from simbev_ros.maps.osm.land_rules import land_rules

_CELL_M = 25.0
_STEP_M = 5.0
_MIN_AREA_M2 = 5000.0
_TOLERANCE_M = 5.0


def built_up_zones(buildings: Sequence[Footprint], streets: AnyArray, extent: BaseGeometry) -> tuple[Zone, ...]:
    """Zones of built-up land, in ascending precedence; land_rules.yaml has the thresholds.

    Densities are means over squares around each cell of a grid.

    Args:
        buildings: The buildings of the file.
        streets: (R,) lines of the roads that make land urban.
        extent: Land outside it is left out.
    """
    rules = land_rules()
    low_m = np.array(extent.bounds[:2])
    shape = np.ceil((np.array(extent.bounds[2:]) - low_m) / _CELL_M).astype(int)
    outlines = np.array([building.outline for building in buildings], dtype=object)
    middle_m = shapely.get_coordinates(shapely.centroid(outlines)).reshape(-1, 2)
    area_m2 = shapely.area(outlines).reshape(-1)
    storeys = np.array([building.height_m for building in buildings]) / rules.storey_m
    pieces = shapely.get_coordinates(shapely.line_interpolate_point(*_stations(streets))).reshape(-1, 2)
    cover, floors, street = (
        _density(points_m, amounts, low_m, shape)
        for points_m, amounts in (
            (middle_m, area_m2),
            (middle_m, area_m2 * storeys),
            (pieces, np.full(len(pieces), _STEP_M)),
        )
    )
    homes = (cover >= rules.homes.building_share) | (street * 1000.0 >= rules.homes.streets_km_per_km2)
    center = floors >= rules.center.floor_area_ratio
    return (
        *(Zone(part, rules.homes.surroundings) for part in _outlines(homes, low_m)),
        *(Zone(part, rules.center.surroundings) for part in _outlines(center, low_m)),
    )


def _stations(streets: AnyArray) -> tuple[AnyArray, Float64Array]:
    """Lines and distances along them, one for every ``_STEP_M`` of street."""
    counts = np.ceil(shapely.length(streets) / _STEP_M).astype(int).reshape(-1)
    first = np.repeat(np.cumsum(counts) - counts, counts)
    return np.repeat(streets, counts), (np.arange(len(first)) - first + 0.5) * _STEP_M


def _density(points_m: Float64Array, amounts: Float64Array, low_m: Float64Array, shape: AnyArray) -> Float64Array:
    """(I, J) mean per square meter, around each cell, of amounts at (N, 2) points."""
    total = np.zeros(shape)
    cell = np.floor((points_m - low_m) / _CELL_M).astype(int)
    inside = ((cell >= 0) & (cell < shape)).all(axis=1)
    np.add.at(total, tuple(cell[inside].T), amounts[inside])
    size = 2 * round(land_rules().built_up_radius_m / _CELL_M) + 1
    return uniform_filter(total, size, mode="constant") / _CELL_M**2


def _outlines(cells: BoolArray, low_m: Float64Array) -> Iterator[shapely.Polygon]:
    """Smooth outlines of the cells that are set, without thin parts and grown by two cells, as densities fall there."""
    padded = np.pad(cells, ((0, 0), (1, 1))).astype(np.int8)
    column, edge = np.nonzero(np.diff(padded, axis=1))
    runs = np.column_stack([column, edge])[0::2], np.column_stack([column, edge])[1::2]
    (x, y0), y1 = (low_m + runs[0] * _CELL_M).T, low_m[1] + runs[1][:, 1] * _CELL_M
    area: BaseGeometry = overlay.union_all(shapely.box(x, y0, x + _CELL_M, y1))
    for step in (1.0, -2.0, 3.0):
        area = shapely.buffer(area, step * _CELL_M, quad_segs=4)
    parts = polygons(shapely.simplify(area, _TOLERANCE_M))
    return (part for part in parts if part.area > _MIN_AREA_M2)
