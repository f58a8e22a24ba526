"""The edges of what is paved: curbs, and where asphalt ends without one, as lines with heights."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.maps.roads.elevation import Elevation
from simbev_ros.maps.roads.layout import Layout
from simbev_ros.maps.roads.surface import surfaces_of
from simbev_ros.types import BoolArray, Float64Array

_SPACING_M = 5.0  # so far apart are heights known
_TOUCHING_M = 0.05
_CRACK_M = 0.05  # half as wide as the widest
_SAME_HEIGHT_M = 0.5


@dataclass(frozen=True, slots=True)
class RoadEdge:
    """One closed edge of the carriageways of a level and their shoulders, or of an island in them.

    Attributes:
        along_m: (N, 3) map frame, the first point being the last too; what is paved lies to the left.
        real: (N - 1,) whether each segment is an edge; false where a structure begins and the road goes on.
        level: Of the road.
    """

    along_m: Float64Array
    real: BoolArray
    level: int


def road_edges(layout: Layout) -> Iterator[RoadEdge]:
    """The edges of all levels, in order of level."""
    elevation = Elevation(layout)
    paved = [_paved(layout, level) for level in layout.levels]
    for level, area in enumerate(paved):
        parts = shapely.reverse(
            shapely.normalize(shapely.get_parts(area))
        )  # what is normal has its inside to the right
        for ring in shapely.segmentize(shapely.get_rings(parts), _SPACING_M):
            xy_m = shapely.get_coordinates(ring)
            along_m = np.column_stack([xy_m, elevation.height_m(xy_m, level)])
            middle_m = (along_m[1:] + along_m[:-1]) / 2.0
            goes_on = np.zeros(len(middle_m), bool)
            for other in layout.levels:
                if other != level:
                    goes_on |= _on(middle_m, paved[other], elevation, other)
            yield RoadEdge(along_m, ~goes_on, level)


def _paved(layout: Layout, level: int) -> BaseGeometry:
    """What is paved on a level, without the cracks between road and shoulder."""
    surfaces = surfaces_of(layout, level)
    paved = shapely.union(surfaces.road, surfaces.shoulder)
    for margin_m in (_CRACK_M, -_CRACK_M):
        paved = shapely.buffer(paved, margin_m, join_style="mitre")
    shapely.prepare(paved)
    return paved


def _on(places_m: Float64Array, area: BaseGeometry, elevation: Elevation, level: int) -> BoolArray:
    """(N,) whether (N, 3) places touch the paved area of a level at its height."""
    touching = np.asarray(shapely.dwithin(area, shapely.points(places_m[:, :2]), _TOUCHING_M), bool)
    height_m = elevation.height_m(places_m[touching, :2], level)
    touching[touching] = np.abs(height_m - places_m[touching, 2]) < _SAME_HEIGHT_M
    return touching
