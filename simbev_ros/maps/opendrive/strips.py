"""Builds the strips of the layout: one per stretch of a lane with constant paint, speed limit and structure."""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace
from itertools import groupby, pairwise
from typing import NamedTuple

import numpy as np

from simbev_ros.maps.findings import Findings
from simbev_ros.maps.opendrive.lane_shapes import LaneShape
from simbev_ros.maps.opendrive.links import LaneLinks
from simbev_ros.maps.opendrive.reading.document import (
    Document,
    LaneKey,
    LaneRecord,
    on_stretch,
    stretches_near,
    value_at,
)
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import Line, Paint, Strip

_MIN_WIDTH_M = 0.02
_MIN_LENGTH_M = 0.02
_MIRRORED = {Paint.SOLID_BROKEN: Paint.BROKEN_SOLID, Paint.BROKEN_SOLID: Paint.SOLID_BROKEN}


class _Traits(NamedTuple):
    """Properties that are constant along a strip; paint as seen from inside the lane."""

    inner: Line
    outer: Line
    speed_mps: float
    structure: bool
    tunnel: bool


def strips_of(
    document: Document, shapes: Mapping[LaneKey, LaneShape], links: LaneLinks, notes: Findings
) -> tuple[Strip, ...]:
    """All strips of a document, in the order of the shapes."""
    unlinked = {key: tuple(_lane_strips(shape, notes)) for key, shape in shapes.items()}
    used = {key for key, strips in unlinked.items() if strips}
    lanes = {LaneKey(road.id, section.index, lane.id): lane for road, section, lane in document.lanes()}
    joined = []
    for key in (key for key in unlinked if key in used):
        forward = shapes[key].runs_forward
        higher, lower = (_beside(key, step, lanes, used) for step in (1, -1))
        left, right = (higher, lower) if forward else (lower, higher)
        following = tuple(map(str, links.following(key, "end" if forward else "start", used)))
        joined += [replace(strip, left=left, right=right, following=following) for strip in unlinked[key]]
    return tuple(joined)


def _beside(key: LaneKey, step: int, lanes: Mapping[LaneKey, LaneRecord], used: Collection[LaneKey]) -> str:
    """Id of the lane adjacent to another one on the side of higher (``step`` 1) or lower (-1) lane ids, or ""."""
    number = key.lane
    while True:
        number += step if number != -step else 2 * step
        beside = key._replace(lane=number)
        if beside in used:
            return str(beside)
        if beside not in lanes or lanes[beside].kind is None:
            return ""


def _lane_strips(shape: LaneShape, notes: Findings) -> Iterator[Strip]:
    """Strips of one lane of one section, without links to adjacent lanes."""
    stretches = tuple(_stretches(shape))
    if not stretches:
        detail = f"lane {shape.lane.id} of road {shape.road.id}"
        notes.left_out("a lane without width or length is left out", shape.road.element, detail)
    forward = shape.runs_forward
    order = slice(None) if forward else slice(None, None, -1)
    for count, (first, last, traits) in enumerate(stretches):
        borders = [
            (line[first : last + 1], paint)
            for line, paint in ((shape.inner_m, traits.inner), (shape.outer_m, traits.outer))
        ]
        if (shape.lane.id > 0) == forward:
            borders.reverse()
        (left_m, left_line), (right_m, right_line) = borders
        raised_m = None if shape.raised_m is None else shape.raised_m[first : last + 1][order]
        if raised_m is not None and (shape.lane.id > 0) == forward:
            raised_m = raised_m[:, ::-1]
        section, s_m = shape.section, shape.s_m
        yield Strip(
            id=f"{shape.key}/{count}",
            lane=str(shape.key),
            kind=shape.lane.kind or LaneKind.DRIVING,
            left_m=np.ascontiguousarray(left_m[order]),
            right_m=np.ascontiguousarray(right_m[order]),
            s_start_m=float(s_m[first] - section.start_m if forward else section.end_m - s_m[last]),
            left_line=left_line,
            right_line=right_line,
            road=shape.road.id,
            section=section.index,
            index=shape.lane.id,
            junction=shape.road.junction,
            speed_mps=traits.speed_mps,
            structure=traits.structure,
            tunnel=traits.tunnel,
            raised_m=None if raised_m is None else np.ascontiguousarray(raised_m),
        )


def _stretches(shape: LaneShape) -> Iterator[tuple[int, int, _Traits]]:
    """First and last sample of each stretch on which the lane has a width and its traits are constant."""
    s_m, width_m = shape.s_m, shape.width_m
    cut = np.zeros(len(s_m), bool)
    cut[np.searchsorted((s_m[1:] + s_m[:-1]) / 2.0, _changes_m(shape))] = True
    wide = np.maximum(width_m[:-1], width_m[1:]) > _MIN_WIDTH_M
    cut[1:-1] |= wide[1:] != wide[:-1]
    cut[[0, -1]] = True
    pieces = [
        (first, last, _traits(shape, float(s_m[first] + s_m[last]) / 2.0) if wide[first] else None)
        for first, last in pairwise(np.flatnonzero(cut).tolist())
    ]
    for traits, group in groupby(pieces, key=lambda piece: piece[2]):
        run = list(group)
        if traits is not None and s_m[run[-1][1]] - s_m[run[0][0]] >= _MIN_LENGTH_M:
            yield run[0][0], run[-1][1], traits


def _changes_m(shape: LaneShape) -> list[float]:
    """Distances along the road at which traits may change."""
    section, lane, road = shape.section, shape.lane, shape.road
    marks = section.marks
    stretches = [
        stretch
        for kind in (road.bridges, road.tunnels)
        for stretch in stretches_near(kind, section.start_m, section.end_m)
    ]
    local = (marks.get(_inner_lane_id(lane), ()), marks.get(lane.id, ()), lane.speeds)
    in_section = [section.start_m + ds_m for changes in local for ds_m, _ in changes]
    return [
        *in_section,
        *(s_m for s_m, _ in road.speeds),
        *(s_m for stretch in stretches for s_m in stretch),
    ]


def _traits(shape: LaneShape, s_m: float) -> _Traits:
    """Traits at a distance along the road.

    The file describes paint from the lane that it belongs to outward, and on the center line from left to right.
    """
    lane, road = shape.lane, shape.road
    ds_m = s_m - shape.section.start_m
    inner, outer = (
        value_at(shape.section.marks.get(number, ()), ds_m) or Line() for number in (_inner_lane_id(lane), lane.id)
    )
    if lane.id != 1:
        inner = replace(inner, paint=_MIRRORED.get(inner.paint, inner.paint))
    speed_mps = shape.speed_mps(s_m)
    return _Traits(inner, outer, speed_mps, on_stretch(road.bridges, s_m), on_stretch(road.tunnels, s_m))


def _inner_lane_id(lane: LaneRecord) -> int:
    """Id of the lane whose outer border is this one's inner border."""
    return lane.id - (1 if lane.id > 0 else -1)
