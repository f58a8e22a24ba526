"""Center lines of the paint along lanes: each divider once, even if several lanes share it."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.geometry.plan_view import left_of
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.roads.bands import painted_lines
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import Layout, Paint, PaintColor, Strip
from simbev_ros.maps.roads.markings import MarkingKind, painted_sides
from simbev_ros.maps.roads.polylines import Polylines
from simbev_ros.maps.roads.surface import crosswalk_polygons, strip_polygons

_MIRRORED = {Paint.SOLID_BROKEN: Paint.BROKEN_SOLID, Paint.BROKEN_SOLID: Paint.SOLID_BROKEN}

_PROBE_OFFSET_M = 0.4
_MIN_PARALLEL_COSINE = 0.8


@dataclass(frozen=True, slots=True)
class LinePath:
    """Center line of a painted line, or of two parallel lines.

    Attributes:
        kind: What it separates: lanes of one direction, opposite directions, or the road and the area beside it.
        paint: Seen from left to right of the path.
        color: Color of the paint.
        width_m: Width of one line.
        level: Level of the road.
        along_m: (N, 3) map frame.
    """

    kind: MarkingKind
    paint: Paint
    color: PaintColor
    width_m: float
    level: int
    along_m: Float64Array


def line_paths(layout: Layout, level: int) -> Iterator[LinePath]:
    """Yield the line paths of one level, interrupted at crosswalks as the paint is."""
    sides = painted_sides(layout, level)
    row, paths = painted_lines([border for border, _, _ in sides])
    crosswalks = crosswalk_polygons([each for each in layout.crosswalks if each.level == level])
    parts, source = shapely.get_parts(overlay.difference(paths, overlay.union_all(crosswalks)), return_index=True)
    lines_m = [np.asarray(shapely.get_coordinates(part, include_z=True), np.float64) for part in parts]
    between = _between_lanes(layout.strips_of(LaneKind.DRIVING, level=level), lines_m)
    for number, along_m, divider_kind in zip(row[source].tolist(), lines_m, between, strict=True):
        border, kind, color = sides[number]
        paint = border.paint if border.outward < 0.0 else _MIRRORED.get(border.paint, border.paint)
        if kind is MarkingKind.EDGE and divider_kind is not None:
            kind = divider_kind
        yield LinePath(kind, paint, color, border.width_m, level, along_m)


def _between_lanes(strips: Sequence[Strip], lines_m: Sequence[Float64Array]) -> list[MarkingKind | None]:
    """Kind of each line that has a lane on both sides at its middle, else None.

    Needed in junctions, where strips do not name their neighbors.
    """
    if not strips or not lines_m:
        return [None] * len(lines_m)
    lines = Polylines.from_lines(lines_m)
    row = np.arange(len(lines))
    parameter = lines.parameter(row, lines.length_m / 2.0)
    heading = lines.headings(parameter)
    offset_m = _PROBE_OFFSET_M * left_of(heading)
    centers = Polylines.from_lines([strip.center_m for strip in strips])
    shapes = np.array([shapely.LineString(strip.center_m[:, :2]) for strip in strips], object)
    tree = shapely.STRtree(strip_polygons(strips))
    cosines = np.zeros((2, len(lines)))  # cosine of the angle to the lane on either side, 0 if there is none
    for side, sign in enumerate((1.0, -1.0)):
        points = np.asarray(shapely.points(lines.values(parameter)[:, :2] + sign * offset_m), object)
        line, strip = tree.query(points, predicate="intersects")
        s_m = shapely.line_locate_point(shapes[strip], points[line])
        cosine = np.sum(centers.headings(centers.parameter(strip, s_m)) * heading[line], axis=1)
        order = np.argsort(
            np.abs(cosine), kind="stable"
        )  # of crossing lanes, the one most parallel to the line is chosen
        cosines[side, line[order]] = cosine[order]
    is_divider = np.min(np.abs(cosines), axis=0) > _MIN_PARALLEL_COSINE
    same_direction = (cosines[0] * cosines[1] > 0.0).tolist()
    kinds = [MarkingKind.LANE if each else MarkingKind.CENTER for each in same_direction]
    return [kind if found else None for kind, found in zip(kinds, is_divider.tolist(), strict=True)]
