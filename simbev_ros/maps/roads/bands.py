"""Computes the areas of painted lines in plan view: solid and broken lines, single and double, and rows of dots."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from scipy.spatial import cKDTree

from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.geometry.ragged import ragged_indices
from simbev_ros.foundation.types import AnyArray, BoolArray, Float64Array, Int64Array
from simbev_ros.maps.roads.layout import Paint
from simbev_ros.maps.roads.polylines import Polylines

_DASH_M, _DASH_GAP_M = 3.0, 6.0
_CLEARANCE_M = 1.0  # distance of dashes and dots from both ends of a lane
_DOT_RADIUS_M, _DOT_SPACING_M, _DOT_CORNERS = 0.05, 1.2, 12
_SAME_POSITION_M = 0.05
_OVERLAP_DISTANCE_M = 0.35
_MIN_LENGTH_M = 0.5
_SOLID, _DASHED, _DOTTED = range(3)
_Sides = tuple[Float64Array, Float64Array]  # left and right edges of all lines, by point
_PARTS: dict[Paint, tuple[tuple[float, int], ...]] = {
    Paint.SOLID: ((0.0, _SOLID),),
    Paint.BROKEN: ((0.0, _DASHED),),
    Paint.SOLID_SOLID: ((-1.0, _SOLID), (1.0, _SOLID)),
    Paint.SOLID_BROKEN: ((-1.0, _SOLID), (1.0, _DASHED)),
    Paint.BROKEN_SOLID: ((-1.0, _DASHED), (1.0, _SOLID)),
    Paint.BROKEN_BROKEN: ((-1.0, _DASHED), (1.0, _DASHED)),
    Paint.BOTTS_DOTS: ((0.0, _DOTTED),),
}
"""For each paint its lines: lateral offset from the border in line widths, positive outward, and style."""


@dataclass(frozen=True, slots=True)
class Border:
    """A painted border of a lane.

    Attributes:
        along_m: (N, 2 or 3) in the lane's direction, map frame.
        paint: Its lines, seen from the lane's inside outward.
        width_m: Width of one line.
        outward: 1 if the outside of the lane is to the left of the border, -1 if it is to the right.
        inset_m: Distance by which the middle of the paint lies inside the border.
    """

    along_m: Float64Array
    paint: Paint
    width_m: float
    outward: float
    inset_m: float


def painted_bands(borders: Sequence[Border]) -> tuple[Int64Array, AnyArray]:
    """The areas of all lines; of borders with the same line at the same position, only the first one's.

    Returns:
        (K,) border of each area, and (K,) polygons.
    """
    parts = [
        (row, border.outward * (factor * border.width_m - border.inset_m), border.width_m / 2.0, style)
        for row, border in enumerate(borders)
        for factor, style in _PARTS.get(border.paint, ())
    ]
    row, left_m, half_m, style = np.array(parts, np.float64).reshape(-1, 4).T
    lines = Polylines.from_lines([borders[int(each)].along_m[:, :2] for each in row], dimensions=2)
    stretches, source = _stretches(lines, left_m, row, style)
    lines = Polylines.from_lines([shapely.get_coordinates(stretch) for stretch in stretches], dimensions=2)
    sides_m = lines.offset_to_left(half_m[source][lines.row]), lines.offset_to_left(-half_m[source][lines.row])
    bands = [
        areas_of(lines, np.flatnonzero(style[source] == kind), sides_m)
        for kind, areas_of in ((_SOLID, _solid), (_DASHED, _dashes), (_DOTTED, _dots))
    ]
    line = np.concatenate([each for each, _ in bands])
    return row[source[line]].astype(np.int64), np.concatenate([polygons for _, polygons in bands])


def painted_lines(borders: Sequence[Border]) -> tuple[Int64Array, AnyArray]:
    """Center lines of the paint, double lines as one; of borders at the same position only the first one's is returned.

    Returns:
        (K,) border of each line, and (K,) linestrings in the border's direction, with heights.
    """
    left_m = np.array([-border.outward * border.inset_m for border in borders], np.float64)
    lines = Polylines.from_lines([border.along_m for border in borders])
    stretches, row = _stretches(lines, left_m, np.arange(len(borders), dtype=np.float64), np.zeros(len(borders)))
    return row, stretches


def _stretches(
    lines: Polylines, left_m: Float64Array, row: Float64Array, style: Float64Array
) -> tuple[AnyArray, Int64Array]:
    """(K,) stretches of lines offset by (L,) to the left, without duplicates, and (K,) index of their lines."""
    middles_m = lines.offset_to_left(left_m[lines.row])
    selected = np.flatnonzero(_first_of_each(lines, middles_m, style) & (lines.length_m > _MIN_LENGTH_M))
    shapes = np.array([shapely.LineString(middle_m) for middle_m in lines.split(middles_m)], object)[selected]
    stretches, source = shapely.get_parts(_subtract_earlier(shapes, row[selected]), return_index=True)
    long = shapely.length(stretches) > _MIN_LENGTH_M
    return stretches[long], selected[source[long]]


def _first_of_each(lines: Polylines, middles_m: Float64Array, style: Float64Array) -> BoolArray:
    """(L,) whether no earlier line of the same style has its middle at the same position; (P, 2) ``middles_m``."""
    if len(lines) == 0:
        return np.zeros(0, bool)
    midpoints_m = lines.values(lines.parameter(np.arange(len(lines)), lines.length_m / 2.0), middles_m)
    pairs = cKDTree(midpoints_m).query_pairs(_SAME_POSITION_M, output_type="ndarray").reshape(-1, 2)
    first = np.ones(len(lines), bool)
    first[pairs[style[pairs[:, 0]] == style[pairs[:, 1]], 1]] = False
    return first


def _subtract_earlier(lines: AnyArray, row: Float64Array) -> AnyArray:
    """(L,) lines without the stretches that run along earlier ones of other borders, as where roads overlap."""
    earlier, later = shapely.STRtree(lines).query(lines, predicate="dwithin", distance=_OVERLAP_DISTANCE_M)
    ordered = (earlier < later) & (row[earlier] != row[later])
    earlier, later = earlier[ordered], later[ordered]
    occupied = shapely.buffer(lines, _OVERLAP_DISTANCE_M, cap_style="flat")
    remaining = lines.copy()
    for each in np.unique(later).tolist():
        remaining[each] = overlay.difference(lines[each], overlay.union_all(occupied[earlier[later == each]]))
    return remaining


def _solid(lines: Polylines, chosen: Int64Array, sides_m: _Sides) -> tuple[Int64Array, AnyArray]:
    """Areas of the chosen lines over their full length: (K,) lines and (K,) polygons."""
    bounds = [(lines.first[line], lines.first[line + 1]) for line in chosen]
    shapes = [np.concatenate([sides_m[0][start:end], sides_m[1][start:end][::-1]]) for start, end in bounds]
    polygons = np.array([shapely.Polygon(shape) for shape in shapes], object)
    folded = ~shapely.is_valid(
        polygons
    )  # self-intersecting on the inner side of bends with a radius below the line's width
    polygons[folded] = shapely.buffer(polygons[folded], 0.0)
    return chosen, polygons


def _dashes(lines: Polylines, chosen: Int64Array, sides_m: _Sides) -> tuple[Int64Array, AnyArray]:
    """Dashes on each chosen line, as many as fit, placed symmetrically: (K,) lines and (K,) polygons."""
    line, start_m = _spread_pieces(lines, chosen, _DASH_M, _DASH_GAP_M)
    parameters = [lines.parameter(line, start_m + part * _DASH_M) for part in (0.0, 0.5, 1.0)]
    left_m, right_m = ([lines.values(parameter, side_m) for parameter in parameters] for side_m in sides_m)
    return line, np.asarray(shapely.polygons(np.stack([*left_m, *reversed(right_m)], axis=1)), object)


def _dots(lines: Polylines, chosen: Int64Array, sides_m: _Sides) -> tuple[Int64Array, AnyArray]:
    """Dots on each chosen line: (K,) lines and (K,) polygons."""
    line, start_m = _spread_pieces(lines, chosen, 2.0 * _DOT_RADIUS_M, _DOT_SPACING_M - 2.0 * _DOT_RADIUS_M)
    parameter = lines.parameter(line, start_m + _DOT_RADIUS_M)
    center_m = (lines.values(parameter, sides_m[0]) + lines.values(parameter, sides_m[1])) / 2.0
    angle_rad = 2.0 * np.pi * np.arange(_DOT_CORNERS) / _DOT_CORNERS
    circle_m = _DOT_RADIUS_M * np.column_stack([np.cos(angle_rad), np.sin(angle_rad)])
    return line, np.asarray(shapely.polygons(center_m[:, None] + circle_m), object)


def _spread_pieces(
    lines: Polylines, chosen: Int64Array, piece_m: float, gap_m: float
) -> tuple[Int64Array, Float64Array]:
    """(K,) lines and (K,) starts of pieces: as many as fit between the clearances at both ends, symmetrically."""
    length_m, period_m = lines.length_m[chosen], piece_m + gap_m
    count = np.maximum((length_m - 2.0 * _CLEARANCE_M + gap_m) // period_m, 0.0).astype(np.int64)
    line, index = ragged_indices(count)
    first_m = (length_m - count * period_m + gap_m) / 2.0
    return chosen[line], first_m[line] + period_m * index
