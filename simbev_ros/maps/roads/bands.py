"""Painted lines as areas: solid and broken lines, single and double, and rows of dots, many at once."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from scipy.spatial import cKDTree

from simbev_ros.maps.roads.layout import Paint
from simbev_ros.maps.roads.polylines import Polylines
from simbev_ros.types import AnyArray, BoolArray, Float64Array, Int64Array

_DASH_M, _DASH_GAP_M = 3.0, 6.0
_CLEARANCE_M = 1.0  # of dashes and dots, from both ends of a lane
_DOT_RADIUS_M, _DOT_SPACING_M, _DOT_CORNERS = 0.05, 1.2, 12
_SAME_PLACE_M = 0.05
_ALONG_M = 0.35
_SHORTEST_M = 0.5
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
"""Each line of a paint: how many of its widths outward from the border it lies, and its style."""


@dataclass(frozen=True, slots=True)
class Border:
    """A painted border of a lane.

    Attributes:
        along_m: (N, 2 or 3) in the lane's direction, map frame.
        paint: Which lines, seen from the lane's inside outward.
        width_m: Of one line.
        outward: 1 if the lane's outside is to the left of the border, -1 if it is to the right.
        inset_m: How far the middle of the paint lies inside of the border.
    """

    along_m: Float64Array
    paint: Paint
    width_m: float
    outward: float
    inset_m: float


def painted_bands(borders: Sequence[Border]) -> tuple[Int64Array, AnyArray]:
    """The areas of all lines; where two borders bear the same line at the same place, it is the first one's.

    Returns:
        (K,) border of each area, and (K,) polygons.
    """
    parts = [
        (row, border.outward * (number * border.width_m - border.inset_m), border.width_m / 2.0, style)
        for row, border in enumerate(borders)
        for number, style in _PARTS.get(border.paint, ())
    ]
    row, left_m, half_m, style = np.array(parts, np.float64).reshape(-1, 4).T
    lines = Polylines.of([borders[int(each)].along_m[:, :2] for each in row], dimensions=2)
    stretches, source = _stretches(lines, left_m, row, style)
    lines = Polylines.of([shapely.get_coordinates(stretch) for stretch in stretches], dimensions=2)
    sides_m = lines.beside(half_m[source][lines.row]), lines.beside(-half_m[source][lines.row])
    painted = [
        areas_of(lines, np.flatnonzero(style[source] == kind), sides_m)
        for kind, areas_of in ((_SOLID, _solid), (_DASHED, _dashes), (_DOTTED, _dots))
    ]
    line = np.concatenate([each for each, _ in painted])
    return row[source[line]].astype(np.int64), np.concatenate([polygons for _, polygons in painted])


def painted_lines(borders: Sequence[Border]) -> tuple[Int64Array, AnyArray]:
    """Where paint runs: its middle, double lines as one; of borders at the same place it is the first one's.

    Returns:
        (K,) border of each line, and (K,) linestrings in the border's direction, with heights.
    """
    left_m = np.array([-border.outward * border.inset_m for border in borders], np.float64)
    lines = Polylines.of([border.along_m for border in borders])
    stretches, row = _stretches(lines, left_m, np.arange(len(borders), dtype=np.float64), np.zeros(len(borders)))
    return row, stretches


def _stretches(
    lines: Polylines, left_m: Float64Array, row: Float64Array, style: Float64Array
) -> tuple[AnyArray, Int64Array]:
    """(K,) stretches of what runs (L,) to the left of lines, each place once, and (K,) the line that each is beside."""
    middles_m = lines.beside(left_m[lines.row])
    wanted = np.flatnonzero(_first_of_each(lines, middles_m, style) & (lines.length_m > _SHORTEST_M))
    shapes = np.array([shapely.LineString(middle_m) for middle_m in lines.split(middles_m)], object)[wanted]
    stretches, source = shapely.get_parts(_apart(shapes, row[wanted]), return_index=True)
    long = shapely.length(stretches) > _SHORTEST_M
    return stretches[long], wanted[source[long]]


def _first_of_each(lines: Polylines, middles_m: Float64Array, style: Float64Array) -> BoolArray:
    """(L,) whether no earlier line of the same style has its middle at the same place; (P, 2) ``middles_m``."""
    if len(lines) == 0:
        return np.zeros(0, bool)
    places_m = lines.values(lines.parameter(np.arange(len(lines)), lines.length_m / 2.0), middles_m)
    pairs = cKDTree(places_m).query_pairs(_SAME_PLACE_M, output_type="ndarray").reshape(-1, 2)
    first = np.ones(len(lines), bool)
    first[pairs[style[pairs[:, 0]] == style[pairs[:, 1]], 1]] = False
    return first


def _apart(lines: AnyArray, row: Float64Array) -> AnyArray:
    """(L,) lines without the stretches that run along earlier ones of other borders, as where roads overlap."""
    earlier, later = shapely.STRtree(lines).query(lines, predicate="dwithin", distance=_ALONG_M)
    ordered = (earlier < later) & (row[earlier] != row[later])
    earlier, later = earlier[ordered], later[ordered]
    taken = shapely.buffer(lines, _ALONG_M, cap_style="flat")
    rest = lines.copy()
    for each in np.unique(later).tolist():
        rest[each] = shapely.difference(lines[each], shapely.union_all(taken[earlier[later == each]]))
    return rest


def _solid(lines: Polylines, chosen: Int64Array, sides_m: _Sides) -> tuple[Int64Array, AnyArray]:
    """Chosen lines as areas all along: (K,) lines and (K,) polygons."""
    bounds = [(lines.first[line], lines.first[line + 1]) for line in chosen]
    shapes = [np.concatenate([sides_m[0][start:end], sides_m[1][start:end][::-1]]) for start, end in bounds]
    polygons = np.array([shapely.Polygon(shape) for shape in shapes], object)
    folded = ~shapely.is_valid(polygons)  # on the inner side of bends that are sharper than the line is wide
    polygons[folded] = shapely.buffer(polygons[folded], 0.0)
    return chosen, polygons


def _dashes(lines: Polylines, chosen: Int64Array, sides_m: _Sides) -> tuple[Int64Array, AnyArray]:
    """As many dashes as fit on each chosen line, placed symmetrically: (K,) lines and (K,) polygons."""
    line, start_m = _spread(lines, chosen, _DASH_M, _DASH_GAP_M)
    at = [lines.parameter(line, start_m + part * _DASH_M) for part in (0.0, 0.5, 1.0)]
    left_m, right_m = ([lines.values(place, side_m) for place in at] for side_m in sides_m)
    return line, np.asarray(shapely.polygons(np.stack([*left_m, *reversed(right_m)], axis=1)), object)


def _dots(lines: Polylines, chosen: Int64Array, sides_m: _Sides) -> tuple[Int64Array, AnyArray]:
    """Dots on each chosen line: (K,) lines and (K,) polygons."""
    line, start_m = _spread(lines, chosen, 2.0 * _DOT_RADIUS_M, _DOT_SPACING_M - 2.0 * _DOT_RADIUS_M)
    place = lines.parameter(line, start_m + _DOT_RADIUS_M)
    center_m = (lines.values(place, sides_m[0]) + lines.values(place, sides_m[1])) / 2.0
    angle_rad = 2.0 * np.pi * np.arange(_DOT_CORNERS) / _DOT_CORNERS
    circle_m = _DOT_RADIUS_M * np.column_stack([np.cos(angle_rad), np.sin(angle_rad)])
    return line, np.asarray(shapely.polygons(center_m[:, None] + circle_m), object)


def _spread(lines: Polylines, chosen: Int64Array, piece_m: float, gap_m: float) -> tuple[Int64Array, Float64Array]:
    """(K,) lines of pieces and (K,) where they start: as many as fit between the clear ends, symmetrically."""
    length_m, period_m = lines.length_m[chosen], piece_m + gap_m
    count = np.maximum((length_m - 2.0 * _CLEARANCE_M + gap_m) // period_m, 0.0).astype(np.int64)
    number = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    first_m = (length_m - count * period_m + gap_m) / 2.0
    return np.repeat(chosen, count), np.repeat(first_m, count) + period_m * number
