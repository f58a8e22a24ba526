"""Overlays of areas and lines in plan view that succeed on imperfect geometry as well.

The functions are those of shapely, with the same results. Where GEOS rejects the geometry of a map (self-touching
outlines, mixed dimensions, edges that nearly coincide), the geometry is repaired and the overlay repeated on a
precision grid, from fine to coarse. The same happens where the result is larger than its operands allow: of an outline
that crosses itself by a rounding error, GEOS may return everything but the area.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.foundation.types import AnyArray

_GRIDS_M = (1e-6, 1e-4, 1e-3, 1e-2, 0.1)
"""Precision grids of further attempts, coordinates in meters; the last one still separates lines of paint."""
_MAX_EXCESS_M2 = 1.0
"""Excess of a result's area that invalid operands and precision grids explain."""


def intersection(a: Any, b: Any, grid_size: float | None = None) -> Any:
    """Common part of geometries, see ``shapely.intersection``: scalars or arrays that broadcast."""
    return _pairwise(shapely.intersection, np.minimum, a, b, grid_size)


def difference(a: Any, b: Any, grid_size: float | None = None) -> Any:
    """Part of ``a`` outside ``b``, see ``shapely.difference``: scalars or arrays that broadcast."""
    return _pairwise(shapely.difference, lambda area_a, area_b: area_a, a, b, grid_size)


def union(a: Any, b: Any, grid_size: float | None = None) -> Any:
    """Merged geometries, see ``shapely.union``: scalars or arrays that broadcast."""
    return _pairwise(shapely.union, np.add, a, b, grid_size)


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


def _pairwise(
    operation: Callable[..., Any], max_area: Callable[[Any, Any], Any], a: Any, b: Any, grid_size: float | None
) -> Any:
    """An overlay of scalars or arrays; ``max_area`` returns the maximum area of a result for areas of operands."""
    try:
        found = operation(a, b, grid_size=grid_size)
    except shapely.GEOSException:
        return np.frompyfunc(lambda one, other: _single(operation, one, other, grid_size), 2, 1)(a, b)
    is_wrong = shapely.area(found) > max_area(shapely.area(a), shapely.area(b)) + _MAX_EXCESS_M2
    if not np.any(is_wrong):
        return found
    again = np.frompyfunc(lambda one, other: _repaired(operation, one, other, grid_size), 2, 1)
    if np.ndim(found) == 0:
        return again(a, b)
    found[is_wrong] = again(*(operand[is_wrong] for operand in np.broadcast_arrays(a, b)))
    return found


def _single(operation: Callable[..., Any], a: BaseGeometry, b: BaseGeometry, grid_size: float | None) -> BaseGeometry:
    """An overlay of two geometries, repaired and repeated only if these two are what GEOS rejects."""
    try:
        return operation(a, b, grid_size=grid_size)
    except shapely.GEOSException as problem:
        return _repaired(operation, a, b, grid_size, problem)


def _repaired(
    operation: Callable[..., Any],
    a: BaseGeometry,
    b: BaseGeometry,
    grid_size: float | None,
    problem: shapely.GEOSException | None = None,
) -> BaseGeometry:
    """An overlay of two repaired geometries on a precision grid."""
    pair = [repair(a), repair(b)]
    return _repeat(lambda grid_m: operation(*_on_grid(pair, grid_m), grid_size=grid_m), grid_size, problem)


def _on_grid(geometries: Sequence[BaseGeometry], grid_m: float) -> AnyArray:
    """(N,) geometries with coordinates on a grid, valid again."""
    return np.asarray(shapely.set_precision(geometries, grid_m), object)


def _repeat(
    attempt: Callable[[float], BaseGeometry], grid_size: float | None, problem: shapely.GEOSException | None
) -> BaseGeometry:
    """The result of an overlay on the finest grid, not below ``grid_size``, on which GEOS accepts it."""
    for grid_m in sorted({max(grid_m, grid_size or 0.0) for grid_m in _GRIDS_M}):
        try:
            return attempt(grid_m)
        except shapely.GEOSException as again:
            problem = again
    assert problem is not None
    raise problem
