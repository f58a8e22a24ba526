"""The painted lines along lanes as lines: where a divider runs, each once, however many lanes share it."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from simbev_ros.maps.roads.bands import painted_lines
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import Layout, Paint, PaintColor, Strip
from simbev_ros.maps.roads.markings import MarkingKind, painted_sides
from simbev_ros.maps.roads.polylines import Polylines
from simbev_ros.maps.roads.surface import crosswalk_polygons, strip_polygons
from simbev_ros.types import Float64Array

_MIRRORED = {Paint.SOLID_BROKEN: Paint.BROKEN_SOLID, Paint.BROKEN_SOLID: Paint.SOLID_BROKEN}

_ASIDE_M = 0.4
_ALONG = 0.8


@dataclass(frozen=True, slots=True)
class LinePath:
    """The middle of a painted line, or of two lines side by side.

    Attributes:
        kind: What it parts: lanes of one direction, the two directions, or road and what is beside it.
        paint: Seen from left to right of the path.
        color: Of the paint.
        width_m: Of one line.
        level: Of the road.
        along_m: (N, 3) map frame.
    """

    kind: MarkingKind
    paint: Paint
    color: PaintColor
    width_m: float
    level: int
    along_m: Float64Array


def line_paths(layout: Layout, level: int) -> Iterator[LinePath]:
    """The lines of one level, clear of crosswalks as the paint is."""
    sides = painted_sides(layout, level)
    row, paths = painted_lines([border for border, _, _ in sides])
    crosswalks = crosswalk_polygons([each for each in layout.crosswalks if each.level == level])
    parts, source = shapely.get_parts(shapely.difference(paths, shapely.union_all(crosswalks)), return_index=True)
    lines_m = [np.asarray(shapely.get_coordinates(part, include_z=True), np.float64) for part in parts]
    between = _between_lanes(layout.strips_of(LaneKind.DRIVING, level=level), lines_m)
    for number, along_m, parted in zip(row[source].tolist(), lines_m, between, strict=True):
        border, kind, color = sides[number]
        paint = border.paint if border.outward < 0.0 else _MIRRORED.get(border.paint, border.paint)
        if kind is MarkingKind.EDGE and parted is not None:
            kind = parted
        yield LinePath(kind, paint, color, border.width_m, level, along_m)


def _between_lanes(strips: Sequence[Strip], lines_m: Sequence[Float64Array]) -> list[MarkingKind | None]:
    """What lines part that run between two lanes at their middle; in junctions lanes do not name their neighbors."""
    if not strips or not lines_m:
        return [None] * len(lines_m)
    lines = Polylines.of(lines_m)
    row = np.arange(len(lines))
    place = lines.parameter(row, lines.length_m / 2.0)
    heading = lines.headings(place)
    aside_m = _ASIDE_M * np.column_stack([-heading[:, 1], heading[:, 0]])
    centers = Polylines.of([strip.center_m for strip in strips])
    shapes = np.array([shapely.LineString(strip.center_m[:, :2]) for strip in strips], object)
    tree = shapely.STRtree(strip_polygons(strips))
    ahead = np.zeros((2, len(lines)))  # cosine of the angle to the lane on either side, 0 where there is none
    for side, sign in enumerate((1.0, -1.0)):
        points = np.asarray(shapely.points(lines.values(place)[:, :2] + sign * aside_m), object)
        line, strip = tree.query(points, predicate="intersects")
        s_m = shapely.line_locate_point(shapes[strip], points[line])
        cosine = np.sum(centers.headings(centers.parameter(strip, s_m)) * heading[line], axis=1)
        order = np.argsort(np.abs(cosine), kind="stable")  # of lanes that cross each other the one along the line wins
        ahead[side, line[order]] = cosine[order]
    parted = np.min(np.abs(ahead), axis=0) > _ALONG
    same = (ahead[0] * ahead[1] > 0.0).tolist()
    kinds = [MarkingKind.LANE if each else MarkingKind.CENTER for each in same]
    return [kind if found else None for kind, found in zip(kinds, parted.tolist(), strict=True)]
