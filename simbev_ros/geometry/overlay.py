"""Overlays of areas and lines in plan view that succeed on imperfect geometry as well.

The functions are those of shapely, with the same results. Where GEOS rejects the geometry of a map (self-touching
outlines, mixed dimensions, edges that nearly coincide), the geometry is repaired and the overlay repeated on a
precision grid, from fine to coarse.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.types import AnyArray

_GRIDS_M = (1e-6, 1e-4, 1e-3, 1e-2, 0.1)
"""Precision grids of further attempts, coordinates in meters; the last one still tells lines of paint apart."""


def intersection(a: Any, b: Any, grid_size: float | None = None) -> Any:
    """Common part of geometries, see ``shapely.intersection``: scalars or arrays that broadcast."""
    return _pairwise(shapely.intersection, a, b, grid_size)


def difference(a: Any, b: Any, grid_size: float | None = None) -> Any:
    """Part of ``a`` outside ``b``, see ``shapely.difference``: scalars or arrays that broadcast."""
    return _pairwise(shapely.difference, a, b, grid_size)


def union(a: Any, b: Any, grid_size: float | None = None) -> Any:
    """Merged geometries, see ``shapely.union``: scalars or arrays that broadcast."""
    return _pairwise(shapely.union, a, b, grid_size)


def union_all(
    geometries: BaseGeometry | Sequence[BaseGeometry] | AnyArray, grid_size: float | None = None
) -> BaseGeometry:
    """Merged geometry of all (N,) geometries, see ``shapely.union_all``."""
    try:
        return shapely.union_all(geometries, grid_size=grid_size)
    except shapely.GEOSException as problem:
        repaired = [repair(each) for each in np.ravel(np.asarray(geometries, object)).tolist()]

        def merge(grid_m: float) -> BaseGeometry:
            return shapely.union_all(_on_grid(repaired, grid_m), grid_size=grid_m)

        return _repeat(merge, grid_size, problem)


def repair(geometry: BaseGeometry) -> BaseGeometry:
    """The valid geometry of highest dimension that covers what an invalid or mixed one does; None stays None."""
    if geometry is None or geometry.is_empty:
        return geometry
    valid = geometry if geometry.is_valid else shapely.make_valid(geometry)
    parts = shapely.get_parts(shapely.get_parts(valid))
    dimensions = shapely.get_dimensions(parts)
    if len(parts) == 0 or (dimensions == dimensions[0]).all():
        return valid
    return shapely.union_all(parts[dimensions == dimensions.max()], grid_size=_GRIDS_M[0])


def _pairwise(operation: Callable[..., Any], a: Any, b: Any, grid_size: float | None) -> Any:
    try:
        return operation(a, b, grid_size=grid_size)
    except shapely.GEOSException:
        return np.frompyfunc(lambda one, other: _single(operation, one, other, grid_size), 2, 1)(a, b)


def _single(operation: Callable[..., Any], a: BaseGeometry, b: BaseGeometry, grid_size: float | None) -> BaseGeometry:
    """An overlay of two geometries, repaired and repeated only if these two are what GEOS rejects."""
    try:
        return operation(a, b, grid_size=grid_size)
    except shapely.GEOSException as problem:
        pair = [repair(a), repair(b)]
        return _repeat(lambda grid_m: operation(*_on_grid(pair, grid_m), grid_size=grid_m), grid_size, problem)


def _on_grid(geometries: Sequence[BaseGeometry], grid_m: float) -> AnyArray:
    """(N,) geometries with coordinates on a grid, valid again."""
    return np.asarray(shapely.set_precision(geometries, grid_m), object)


def _repeat(
    attempt: Callable[[float], BaseGeometry], grid_size: float | None, problem: shapely.GEOSException
) -> BaseGeometry:
    """The result of an overlay on the finest grid, not below ``grid_size``, on which GEOS accepts it."""
    for grid_m in sorted({max(grid_m, grid_size or 0.0) for grid_m in _GRIDS_M}):
        try:
            return attempt(grid_m)
        except shapely.GEOSException as again:
            problem = again
    raise problem
