"""Describes lanes as Lanelet2 does: neighbors share a bound, successors share the end points of both bounds."""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import shapely
from scipy.spatial import cKDTree

from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.lanelet2.shapes import joined_m, stations_m
from simbev_ros.maps.lanelet2.tags import mirrored
from simbev_ros.maps.plan.lines import simplify
from simbev_ros.maps.roads.layout import Line, Paint, Strip

_SIDES = ("left", "right")
_MIN_PIECE_M, _MAX_GAP_M = 0.5, 1.5
_SAME_POINT_M, _SAME_LINE_M = 0.05, 0.1


class Bound(NamedTuple):
    """A line at lanelets: (N, 3) points, map frame, paint from left to right, and its users.

    These are, by id of a lanelet and "left" or "right", the lanelet and whether it runs against the points.
    """

    points_m: Float64Array
    line: Line
    users: dict[tuple[str, str], tuple[Strip, bool]]


def lanelets_of(strips: Iterable[Strip]) -> tuple[list[Strip], list[Bound]]:
    """The lanelets of lanes, and their bounds.

    Lanes are cut where paint or speed limits of their road change. Ends of lanes that follow each other are joined if
    they are less than 1.5 m apart, unless a lane would have no width left there; ``following`` has those joined.
    """
    lanelets, bounds = _joined({piece.id: piece for piece in _pieces(strips)}), list[Bound]()
    between: dict[tuple[str, str], list[int]] = defaultdict(list)
    for strip in lanelets:
        for side in _SIDES:
            line_m, line = getattr(strip, f"{side}_m"), getattr(strip, f"{side}_line")
            flipped = bool(tuple(line_m[0]) > tuple(line_m[-1]))
            line_m = simplify(line_m[:: -1 if flipped else 1])
            line = replace(line, paint=mirrored(line.paint)) if flipped != (side == "left") else line
            rows = between[str(line_m[0]), str(line_m[-1])]
            row = next((row for row in rows if _is_near(bounds[row].points_m, line_m)), len(bounds))
            if row == len(bounds):
                rows.append(row)
                bounds.append(Bound(line_m, line, {}))
            elif bounds[row].line.paint is Paint.NONE:
                bounds[row] = bounds[row]._replace(line=line)
            bounds[row].users[strip.id, side] = strip, flipped
    return lanelets, bounds


def _is_near(one_m: Float64Array, two_m: Float64Array) -> bool:
    """Whether two lines are the border between two neighbors."""
    one, two = (shapely.LineString(line_m[:, :2]) for line_m in (one_m, two_m))
    return bool(shapely.hausdorff_distance(one, two) < _SAME_LINE_M)


def _pieces(strips: Iterable[Strip]) -> Iterator[Strip]:
    """Yield the stretches of lanes between cuts; ``following`` has ids of pieces."""
    lanes: dict[str, list[Strip]] = defaultdict(list)
    for strip in sorted(strips, key=lambda strip: strip.s_start_m):
        lanes[strip.lane].append(strip)
    offsets = {name: np.cumsum([0, *(len(part.left_m) - 1 for part in parts)]) for name, parts in lanes.items()}
    roads: dict[tuple[str, int, int], list[str]] = defaultdict(list)
    for name, parts in lanes.items():
        roads[parts[0].road, parts[0].section, offsets[name][-1]].append(name)
    for (_, _, last), names in roads.items():
        along_m = stations_m(joined_m([part.center_m for part in lanes[names[0]]]))
        is_along = {name: lanes[name][0].index * lanes[names[0]][0].index > 0 for name in names}
        changes = {
            k if is_along[name] else last - k
            for name in names
            for k, (before, after) in zip(offsets[name][1:], pairwise(lanes[name]), strict=False)
            if not before.junction and _traits(before) != _traits(after)
        }
        marks = [0]
        for k in sorted(changes):
            if min(along_m[k] - along_m[marks[-1]], along_m[-1] - along_m[k]) > _MIN_PIECE_M:
                marks.append(k)
        for name in names:
            left_m, right_m = (joined_m([getattr(part, f"{side}_m") for part in lanes[name]]) for side in _SIDES)
            spans = list(pairwise(sorted(k if is_along[name] else last - k for k in (*marks, last))))
            for number, (start, end) in enumerate(spans, 1):
                part = lanes[name][np.searchsorted(offsets[name], (start + end) / 2.0) - 1]
                after = [f"{lane}#1" for lane in part.following if lane in lanes]
                yield replace(
                    part,
                    id=f"{name}#{number}",
                    lane=f"{name}#{number}",
                    left_m=left_m[start : end + 1],
                    right_m=right_m[start : end + 1],
                    following=tuple(after) if end == last else (f"{name}#{number + 1}",),
                )


def _traits(strip: Strip) -> tuple[Paint, Paint, float]:
    """Properties that a lanelet has along its whole length."""
    return strip.left_line.paint, strip.right_line.paint, strip.speed_mps


def _joined(pieces: Mapping[str, Strip]) -> list[Strip]:
    """The pieces with the successors that they can have in Lanelet2, and with ends at the points where those begin."""
    tree = cKDTree(
        [line_m[row] for piece in pieces.values() for line_m in (piece.left_m, piece.right_m) for row in (0, -1)]
    )
    points_m, owner = tree.data, np.arange(tree.n)
    np.minimum.at(owner, *tree.query_pairs(_SAME_POINT_M, output_type="ndarray").T[::-1])
    owner = owner[owner]
    ends = dict(zip(pieces, owner.reshape(-1, 2, 2).tolist(), strict=True))  # per side: start and end
    moved = dict[int, int]()

    def resolve(row: int) -> int:
        while row in moved:
            row = moved[row]
        return row

    links = []
    for name, piece in pieces.items():
        for after in (after for after in piece.following if pieces[after].kind is piece.kind):
            gaps_m = points_m[[end for _, end in ends[name]]] - points_m[[start for start, _ in ends[after]]]
            links.append((float(np.linalg.norm(gaps_m, axis=1).max()), name, after))
    following: dict[str, list[str]] = defaultdict(list)
    for _, name, after in sorted(link for link in links if link[0] < _MAX_GAP_M):
        (left, right), (next_left, next_right) = (
            [resolve(side[end]) for side in ends[piece]] for piece, end in ((name, 1), (after, 0))
        )
        has_width = (left != right, next_left != next_right)
        if len(set(has_width)) > 1 or (has_width[0] and (left == next_right or right == next_left)):
            continue
        following[name].append(after)
        for pair in ((left, next_left), (right, next_right)):
            stays, moves = pair if not pieces[name].junction or pieces[after].junction else pair[::-1]
            if stays != moves:
                moved[moves] = stays
    places_m = {name: points_m[[[resolve(row) for row in side] for side in sides]] for name, sides in ends.items()}
    return [
        replace(
            piece,
            left_m=_between(piece.left_m, *places_m[name][0]),
            right_m=_between(piece.right_m, *places_m[name][1]),
            following=tuple(following[name]),
        )
        for name, piece in pieces.items()
    ]


def _between(line_m: Float64Array, start_m: Float64Array, end_m: Float64Array) -> Float64Array:
    """(N, 3) a line moved such that it starts and ends at given points."""
    share = stations_m(line_m)[:, None] / max(stations_m(line_m)[-1], 1e-9)
    moved_m = line_m + (1.0 - share) * (start_m - line_m[0]) + share * (end_m - line_m[-1])
    return np.concatenate([[start_m], moved_m[1:-1], [end_m]])
