"""The edges of the paved area as lines with heights: curbs, and the edge of asphalt without a curb."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.types import BoolArray, Float64Array
from simbev_ros.maps.roads.elevation import Elevation
from simbev_ros.maps.roads.layout import Layout
from simbev_ros.maps.roads.surface import surfaces_of

_HEIGHT_SPACING_M = 5.0  # spacing of heights along edges
_TOUCH_DISTANCE_M = 0.05
_HALF_CRACK_M = 0.05  # half the maximum width of cracks to close
_HEIGHT_TOLERANCE_M = 0.5


@dataclass(frozen=True, slots=True)
class RoadEdge:
    """A closed edge of the carriageways of a level and their shoulders, or of an island in them.

    Attributes:
        along_m: (N, 3) map frame, the last point equals the first; the paved area lies to the left.
        real: (N - 1,) whether each segment is an edge; false where a structure begins and the road continues.
        level: Level of the road.
    """

    along_m: Float64Array
    real: BoolArray
    level: int


def road_edges(layout: Layout) -> Iterator[RoadEdge]:
    """Yield the edges of all levels, in order of level."""
    elevation = Elevation(layout)
    paved = [_paved(layout, level) for level in layout.levels]
    for level, area in enumerate(paved):
        parts = shapely.reverse(
            shapely.normalize(shapely.get_parts(area))
        )  # normalized polygons have their inside to the right
        for ring in shapely.segmentize(shapely.get_rings(parts), _HEIGHT_SPACING_M):
            xy_m = shapely.get_coordinates(ring)
            along_m = np.column_stack([xy_m, elevation.height_m(xy_m, level)])
            middle_m = (along_m[1:] + along_m[:-1]) / 2.0
            continues = np.zeros(len(middle_m), bool)
            for other in layout.levels:
                if other != level:
                    continues |= _touches_paved(middle_m, paved[other], elevation, other)
            yield RoadEdge(along_m, ~continues, level)


def _paved(layout: Layout, level: int) -> BaseGeometry:
    """The paved area of a level, without the cracks between road and shoulder."""
    surfaces = surfaces_of(layout, level)
    paved = overlay.union(surfaces.road, surfaces.shoulder)
    for margin_m in (_HALF_CRACK_M, -_HALF_CRACK_M):
        paved = shapely.buffer(paved, margin_m, join_style="mitre")
    shapely.prepare(paved)
    return paved


def _touches_paved(positions_m: Float64Array, area: BaseGeometry, elevation: Elevation, level: int) -> BoolArray:
    """(N,) whether (N, 3) positions touch the paved area of a level at its height."""
    touches = np.asarray(shapely.dwithin(area, shapely.points(positions_m[:, :2]), _TOUCH_DISTANCE_M), bool)
    height_m = elevation.height_m(positions_m[touches, :2], level)
    touches[touches] = np.abs(height_m - positions_m[touches, 2]) < _HEIGHT_TOLERANCE_M
    return touches
