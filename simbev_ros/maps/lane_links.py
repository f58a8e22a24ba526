"""Finds which lane strips follow or adjoin each other, and which strips a stop line or a lane position refers to."""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely

from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.types import AnyArray, Float64Array
from simbev_ros.maps.network import Lane
from simbev_ros.maps.roads.lane_strips import LaneStrips
from simbev_ros.maps.roads.layout import StopLine, Strip
from simbev_ros.maps.roads.polylines import Polylines
from simbev_ros.maps.roads.surface import strip_polygons

_ADJACENT_TOLERANCE_M = 0.1
_MIN_COMMON_M = 0.3  # length of a common border
_MAX_LANE_DISTANCE_M = 2.0


@dataclass(frozen=True, slots=True)
class StripLinks:
    """Ids of a strip's successors, predecessors, and adjacent strips on either side.

    Adjacent strips of one lane are in that lane's order.
    """

    successors: tuple[str, ...]
    predecessors: tuple[str, ...]
    left: tuple[str, ...]
    right: tuple[str, ...]


def strip_links(strips: Sequence[Strip]) -> tuple[StripLinks, ...]:
    """Links of each strip to the other strips, in the order of ``strips``."""
    lanes: dict[str, list[int]] = defaultdict(list)
    for row in sorted(range(len(strips)), key=lambda row: strips[row].s_start_m):
        lanes[strips[row].lane].append(row)
    after: dict[int, list[int]] = {}
    before: dict[int, list[int]] = defaultdict(list)
    for rows in lanes.values():
        after |= {row: [following] for row, following in pairwise(rows)}
        after[rows[-1]] = [lanes[lane][0] for lane in strips[rows[-1]].following if lane in lanes]
    for row in range(len(strips)):
        for following in after[row]:
            before[following].append(row)
    left = _beside(strips, lanes, [strip.left_m for strip in strips], [strip.left for strip in strips])
    right = _beside(strips, lanes, [strip.right_m for strip in strips], [strip.right for strip in strips])
    columns = [after[row] for row in range(len(strips))], [before[row] for row in range(len(strips))], left, right
    return tuple(
        StripLinks(*(tuple(strips[row].id for row in rows) for rows in links)) for links in zip(*columns, strict=True)
    )


def _beside(
    strips: Sequence[Strip], lanes: dict[str, list[int]], borders_m: Sequence[Float64Array], names: Sequence[str]
) -> list[list[int]]:
    """For each strip, the rows of the named lane's strips that its border runs along."""
    beside = [list(lanes.get(name, ())) for name in names]
    ambiguous = [(row, other) for row, others in enumerate(beside) if len(others) > 1 for other in others]
    if not ambiguous:
        return beside
    row, other = np.array(ambiguous, np.int64).T
    borders = np.array([shapely.LineString(borders_m[each][:, :2]) for each in row.tolist()], object)
    areas = shapely.buffer(
        strip_polygons([strips[each] for each in other.tolist()]), _ADJACENT_TOLERANCE_M, quad_segs=1
    )
    common_m = shapely.length(overlay.intersection(borders, areas))
    not_adjacent = {
        pair for pair, length_m in zip(ambiguous, common_m.tolist(), strict=True) if length_m < _MIN_COMMON_M
    }
    return [[other for other in others if (row, other) not in not_adjacent] for row, others in enumerate(beside)]


def strips_at(positions: Sequence[tuple[Lane, float]], driven: LaneStrips) -> list[str]:
    """Ids of the strips at positions on traffic lanes; "" where there is none.

    Args:
        positions: Lane, and distance from its start.
        driven: The driving strips.
    """
    if not positions or not driven.strips:
        return [""] * len(positions)
    lines = Polylines.from_lines([lane.centerline_m for lane, _ in positions])
    parameter = lines.parameter(np.arange(len(positions)), np.array([s_m for _, s_m in positions]))
    points_m, heading = lines.values(parameter), lines.headings(parameter)
    nearest = driven.index.nearest(points_m, np.arctan2(heading[:, 1], heading[:, 0]))
    gap_m = np.linalg.norm(driven.index.lines.values(nearest.parameter) - points_m, axis=1)
    rows = nearest.row.tolist()
    return [
        driven.strips[row].id if gap < _MAX_LANE_DISTANCE_M else ""
        for row, gap in zip(rows, gap_m.tolist(), strict=True)
    ]


def halting_strips(stop_lines: Sequence[StopLine], driven: LaneStrips) -> Iterator[tuple[str, ...]]:
    """For each stop line, yield the ids of the strips where traffic stops at it: those that cross it in its direction.

    Maps do not always give the direction of a stop line: if no strip crosses it in its direction, those that cross it
    in the opposite direction are returned.
    """
    lanes = driven.index.lines if driven.strips else Polylines.from_lines([])
    lines = _plan([line.ends_m for line in stop_lines])
    centers = _plan(lanes.split(lanes.points_m))
    line, strip = np.asarray(shapely.STRtree(centers).query(lines, predicate="intersects"), np.int64)
    level = np.array([each.level for each in driven.strips], np.int64)
    on_same_level = level[strip] == np.array([each.level for each in stop_lines], np.int64)[line]
    line, strip = line[on_same_level], strip[on_same_level]
    s_m = shapely.line_locate_point(centers[strip], shapely.centroid(overlay.intersection(centers[strip], lines[line])))
    across_m = np.array([each.ends_m[1] - each.ends_m[0] for each in stop_lines]).reshape(-1, 3)[line]
    along = lanes.headings(lanes.parameter(strip, s_m)) * np.column_stack([across_m[:, 1], -across_m[:, 0]])
    halting: list[tuple[list[str], list[str]]] = [([], []) for _ in stop_lines]
    for number, row, ahead in zip(line.tolist(), strip.tolist(), (along.sum(axis=1) > 0.0).tolist(), strict=True):
        halting[number][0 if ahead else 1].append(driven.strips[row].id)
    yield from (tuple(sorted(ahead or against)) for ahead, against in halting)


def _plan(lines_m: Sequence[AnyArray]) -> AnyArray:
    """(N,) shapely lines in plan view from N lines of (M, 3) points."""
    return np.array([shapely.LineString(line_m[:, :2]) for line_m in lines_m], object)
