"""Road markings as areas in plan view, level by level: lane lines, stop and yield lines, stripes of crosswalks.

Widths and lengths follow common practice on urban streets (MUTCD 2009, sections 3A.06, 3B.01, 3B.14, 3B.16 and 3B.18).
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
import shapely
from scipy.spatial import cKDTree

from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.geometry.plan_view import left_of
from simbev_ros.foundation.types import AnyArray, Float64Array
from simbev_ros.maps.roads.bands import Border, painted_bands
from simbev_ros.maps.roads.lane_kind import PAVED_KINDS, LaneKind
from simbev_ros.maps.roads.layout import Crosswalk, Layout, Paint, PaintColor, Strip
from simbev_ros.maps.roads.surface import crosswalk_polygons

_DEPENDENCY_M = 10.0  # paint in an area depends only on lanes within this distance
_STOP_LINE_M = 0.4
_TOOTH_M, _TOOTH_GAP_M, _TOOTH_LENGTH_M = 0.5, 0.3, 0.7
_STRIPE_M, _STRIPE_GAP_M = 0.5, 0.5
_STRIPE_MARGIN_M = 0.25  # clearance at both ends of a stripe
_INSET_M = 0.1  # distance from a curb or from the edge of the asphalt
_MIN_THICKNESS_M = 0.02
_OVERLAP_M2 = 1e-6
_MAX_NODE_GAP_M, _MIN_GAP_M, _MIN_STRAIGHT_COSINE = (
    4.5,
    0.05,
    0.95,
)  # limits of the gap between continuing edge lines, and of the cosine of their bend


class MarkingKind(StrEnum):
    """Meaning of a marking."""

    LANE = "lane"
    EDGE = "edge"
    CENTER = "center"
    STOP = "stop"
    YIELD = "yield"
    CROSSWALK = "crosswalk"


@dataclass(frozen=True, slots=True)
class Marking:
    """One painted area, map frame, meters."""

    kind: MarkingKind
    polygon: shapely.Polygon
    color: PaintColor = PaintColor.WHITE


PaintedSide = tuple[Border, MarkingKind, PaintColor]
"""A painted border of a lane, the meaning of its paint, and its color."""


def lane_markings(layout: Layout, level: int = 0, area: shapely.Polygon | None = None) -> tuple[Marking, ...]:
    """All markings of one level; they do not overlap each other, and no line runs through a crosswalk.

    Args:
        layout: Lanes, stop lines and crosswalks.
        level: The level.
        area: A rectangle: restrict the result to its inside, which equals that part of the whole result.
    """
    if area is not None:
        layout = layout.near(area, _DEPENDENCY_M)
    crosswalks = [crosswalk for crosswalk in layout.crosswalks if crosswalk.level == level]
    marks = [*_stripes(crosswalks), *_stop_markings(layout, level), *_lines(layout, level, crosswalks)]
    polygons = _make_disjoint(np.array([mark.polygon for mark in marks], object))
    if area is not None:
        polygons = overlay.intersection(polygons, area)
    parts, row = shapely.get_parts(polygons, return_index=True)
    thick = 2.0 * shapely.area(parts) > _MIN_THICKNESS_M * shapely.length(parts)
    pieces = zip(row[thick].tolist(), parts[thick], strict=True)
    return tuple(Marking(marks[row].kind, part, marks[row].color) for row, part in pieces)


def _lines(layout: Layout, level: int, crosswalks: Sequence[Crosswalk]) -> Iterator[Marking]:
    """Lines along the borders of lanes, interrupted at crosswalks."""
    sides = painted_sides(layout, level)
    row, polygons = painted_bands([border for border, _, _ in sides])
    clipped = overlay.difference(polygons, overlay.union_all(crosswalk_polygons(crosswalks)))
    for number, polygon in zip(row.tolist(), clipped, strict=True):
        _, kind, color = sides[number]
        yield Marking(kind, polygon, color)


def painted_sides(layout: Layout, level: int) -> tuple[PaintedSide, ...]:
    """All painted borders of one level; where several coincide, the one that takes precedence comes first."""
    by_lane = {strip.lane: strip for strip in layout.strips}
    # Where lines coincide, those of roads take precedence over those of junctions.
    strips = sorted((strip for strip in layout.strips if strip.level == level), key=lambda strip: bool(strip.junction))
    sides = [side for strip in strips for side in _sides(strip, by_lane)]
    if layout.corner_radius_m:  # the map has no geometry besides lanes
        sides.extend(_bridge_nodes(tuple(sides)))
    return tuple(sides)


def _sides(strip: Strip, by_lane: Mapping[str, Strip]) -> Iterator[PaintedSide]:
    """The painted borders of a strip, with the meaning of their paint."""
    for along_m, line, neighbor, outward in (
        (strip.left_m, strip.left_line, by_lane.get(strip.left), 1.0),
        (strip.right_m, strip.right_line, by_lane.get(strip.right), -1.0),
    ):
        if line.paint in (Paint.NONE, Paint.CURB):
            continue
        kind, inset_m = MarkingKind.LANE, 0.0
        if neighbor is None or neighbor.kind not in PAVED_KINDS:
            kind = MarkingKind.EDGE
            inset_m = 0.0 if strip.junction else _INSET_M + line.width_m / 2.0
        elif neighbor.kind is LaneKind.SHOULDER or strip.kind is LaneKind.SHOULDER:
            kind = MarkingKind.EDGE
        elif neighbor.left == strip.lane and strip.left == neighbor.lane:
            kind = MarkingKind.CENTER
        yield Border(along_m, line.paint, line.width_m, outward, inset_m), kind, line.color


def _bridge_nodes(sides: Sequence[PaintedSide]) -> Iterator[PaintedSide]:
    """Edge lines that close the gap between two edge lines where a road only continues through a node."""
    edges = [side for side in sides if side[1] is MarkingKind.EDGE and side[0].paint is Paint.SOLID]
    if not edges:
        return
    end_m, start_m = (np.array([border.along_m[index, :2] for border, _, _ in edges]) for index in (-1, 0))
    before = np.array([_direction(border.along_m[-2:, :2]) for border, _, _ in edges])
    after = np.array([_direction(border.along_m[:2, :2]) for border, _, _ in edges])
    near = cKDTree(start_m).query_ball_point(end_m, _MAX_NODE_GAP_M)
    pairs = np.array([(i, j) for i, found in enumerate(near) for j in found if i != j], np.int64).reshape(-1, 2)
    end, start = pairs.T
    gap_m = start_m[start] - end_m[end]
    along_m = np.einsum("ij,ij->i", gap_m, before[end])
    straight = (along_m > _MIN_GAP_M) & (along_m > _MIN_STRAIGHT_COSINE * np.linalg.norm(gap_m, axis=1))
    straight &= np.einsum("ij,ij->i", before[end], after[start]) > _MIN_STRAIGHT_COSINE
    for i, j in pairs[straight].tolist():
        border, kind, color = edges[i]
        if edges[j][2] == color and edges[j][0].outward == border.outward:
            yield replace(border, along_m=np.stack([border.along_m[-1], edges[j][0].along_m[0]])), kind, color


def _direction(step_m: Float64Array) -> Float64Array:
    """(2,) unit vector from the first to the second of (2, 2) points."""
    step = step_m[1] - step_m[0]
    return np.asarray(step / max(float(np.hypot(*step)), 1e-9))


def _stop_markings(layout: Layout, level: int) -> Iterator[Marking]:
    """Stop lines, and yield lines as rows of triangles that point at the approaching traffic."""
    for line in layout.stop_lines:
        if line.level != level:
            continue
        right_m, left_m = line.ends_m[:, :2]
        length_m = float(np.linalg.norm(left_m - right_m))
        across = (left_m - right_m) / length_m
        ahead = np.array([across[1], -across[0]])
        if line.yields:
            for start_m in _piece_starts_m(length_m, _TOOTH_M, _TOOTH_GAP_M):
                base_m = right_m + (start_m + np.array([[0.0], [_TOOTH_M]])) * across + _STOP_LINE_M / 2.0 * ahead
                tooth_m = np.vstack([base_m, base_m.mean(axis=0) - _TOOTH_LENGTH_M * ahead])
                yield Marking(MarkingKind.YIELD, shapely.Polygon(tooth_m))
        else:
            half_m = _STOP_LINE_M / 2.0 * ahead
            bar_m = np.stack([right_m - half_m, right_m + half_m, left_m + half_m, left_m - half_m])
            yield Marking(MarkingKind.STOP, shapely.Polygon(bar_m))


def _stripes(crosswalks: Sequence[Crosswalk]) -> Iterator[Marking]:
    """Stripes of crosswalks: bars in the direction of traffic, across the whole road."""
    for crosswalk, outline in zip(crosswalks, crosswalk_polygons(crosswalks), strict=True):
        axes = np.stack([crosswalk.axis, left_of(crosswalk.axis)])
        low_m, high_m = (end(crosswalk.outline_m[:, :2] @ axes.T, axis=0) for end in (np.min, np.max))
        for start_m in low_m[0] + _piece_starts_m(high_m[0] - low_m[0], _STRIPE_M, _STRIPE_GAP_M):
            bar = shapely.box(start_m, low_m[1] + _STRIPE_MARGIN_M, start_m + _STRIPE_M, high_m[1] - _STRIPE_MARGIN_M)
            corners_m = shapely.get_coordinates(bar) @ axes
            yield Marking(MarkingKind.CROSSWALK, overlay.intersection(shapely.Polygon(corners_m), outline))


def _piece_starts_m(length_m: float, piece_m: float, gap_m: float) -> Float64Array:
    """Starts of pieces along a length: as many as fit, placed symmetrically."""
    count = max(int((length_m + gap_m) // (piece_m + gap_m)), 0)
    first_m = (length_m - count * (piece_m + gap_m) + gap_m) / 2.0
    return np.asarray(first_m + (piece_m + gap_m) * np.arange(count), np.float64)


def _make_disjoint(polygons: AnyArray) -> AnyArray:
    """Subtract from each area all areas before it."""
    earlier, later = shapely.STRtree(polygons).query(polygons, predicate="intersects")
    in_order = earlier < later
    earlier, later = earlier[in_order], later[in_order]
    common_m2 = shapely.area(overlay.intersection(polygons[earlier], polygons[later]))
    earlier, later = earlier[common_m2 > _OVERLAP_M2], later[common_m2 > _OVERLAP_M2]
    remaining = polygons.copy()
    for row in np.unique(later).tolist():
        remaining[row] = overlay.difference(polygons[row], overlay.union_all(polygons[earlier[later == row]]))
    return remaining
