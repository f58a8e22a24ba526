"""Reads the lane sections of an OpenDRIVE road, with the paint on their lane borders."""

from collections.abc import Iterator, Mapping, Sequence
from typing import TypeVar
from xml.etree.ElementTree import Element

import numpy as np

from simbev_ros.foundation.files.limits import MAX_SECTIONS_PER_M
from simbev_ros.maps.findings import Findings
from simbev_ros.maps.opendrive.reading.attributes import Malformed, integer_id, number, start_of
from simbev_ros.maps.opendrive.reading.cubics import Cubics
from simbev_ros.maps.opendrive.reading.document import LaneHeight, LaneRecord, Section
from simbev_ros.maps.opendrive.reading.tables import LANE_KINDS, PAINT_COLORS, PAINT_WIDTHS_M, PAINTS, SPEED_UNITS_MPS
from simbev_ros.maps.roads.layout import Line, Paint

_T = TypeVar("_T")
_FEW_SECTIONS = 100
_MAX_PAINT_WIDTH_M = 1.0
_MAX_SPEED_MPS = 150.0
_MAX_WIDTH_M = 200.0
_OTHER_SIDE = {"left": "right", "right": "left"}
_MAX_HEIGHT_M = 2.0  # heights of lanes are for curbs and sidewalks


def read_sections(road: Element, length_m: float, notes: Findings) -> tuple[tuple[Section, ...], tuple[Section, ...]]:
    """Read the sections of the left and the right side of a <road>.

    Sections that begin at or beyond its end are left out.

    Raises:
        Malformed: There is no section, or one is not usable.
    """
    started = [(start_of(element, "s", notes), element) for element in road.findall("lanes/laneSection")]
    started.sort(key=lambda section: section[0])
    elements = [element for _, element in started]
    if not elements:
        raise Malformed(road, "it has no lane section")
    if len(elements) > _FEW_SECTIONS + MAX_SECTIONS_PER_M * length_m:
        raise Malformed(
            road, f"it has {len(elements)} lane sections; at most {MAX_SECTIONS_PER_M:g} per meter are read"
        )
    starts_m = [0.0, *(start_m for start_m, _ in started[1:])]
    indexed = [(k, s_m, e) for k, (s_m, e) in enumerate(zip(starts_m, elements, strict=True)) if s_m < length_m]
    if len(indexed) < len(elements):
        notes.left_out("a lane section beyond the road's end is left out", elements[-1])
    left, right = (_read_side(indexed, length_m, side, notes) for side in ("left", "right"))
    return left, right


def _read_side(
    indexed: Sequence[tuple[int, float, Element]], length_m: float, side: str, notes: Findings
) -> tuple[Section, ...]:
    """Read the sections of one side; each ends where the next section that describes this side begins."""
    present = [row for row in indexed if row[2].get("singleSide") != "true" or row[2].find(side) is not None]
    ends_m = [*(s_m for _, s_m, _ in present[1:]), length_m]
    sections = []
    for (index, start_m, element), end_m in zip(present, ends_m, strict=True):
        elements = _lanes_of_side(element, side, notes)
        lanes = [_read_lane(elements[number], number, end_m - start_m, notes) for number in sorted(elements, key=abs)]
        centers = ((0, lane) for lane in element.findall("center/lane"))
        marks = {number: _read_marks(lane, notes) for number, lane in (*centers, *elements.items())}
        sections.append(Section(index, start_m, end_m, tuple(lanes), marks))
    return tuple(sections)


def _lanes_of_side(section: Element, side: str, notes: Findings) -> dict[int, Element]:
    """The lanes of one side of a <laneSection> by id; an id of the other side counts more than the element it is in."""
    found: dict[int, Element] = {}
    for listed in (side, _OTHER_SIDE[side]):
        for lane in section.findall(f"{listed}/lane"):
            try:
                number = integer_id(lane)
            except Malformed as problem:
                number = 0
                detail = str(problem)
            else:
                detail = f"lane {number}"
            if number == 0 and listed == side:
                notes.left_out("a lane without an id of its side is left out", lane, detail)
            if number == 0 or (number > 0) != (side == "left"):
                continue
            if listed != side:
                notes.repaired("a lane with an id of the other side is moved there", lane, detail)
            if number in found:
                notes.left_out("a lane with the id of an earlier one is left out", lane, detail)
                continue
            found[number] = lane
    return found


def _read_lane(element: Element, number: int, length_m: float, notes: Findings) -> LaneRecord:
    """Read one <lane> of a section with a length."""
    width, border = (
        Cubics.read(element.findall(name), notes, length_m, _MAX_WIDTH_M, "sOffset") for name in ("width", "border")
    )
    if not width and not border:
        notes.left_out("a lane without width is left out", element)
    return LaneRecord(
        id=number,
        type=element.get("type", "none"),
        kind=LANE_KINDS.get(element.get("type", "none")),
        on_level=element.get("level") in ("true", "1"),
        width=width,
        border=border,
        height=_read_height(element, notes),
        speeds=tuple(
            sorted(
                (start_of(speed, "sOffset", notes, is_optional=True), speed_mps)
                for speed in element.findall("speed")
                for speed_mps in [read_speed(speed, notes)]
                if speed_mps is not None
            )
        ),
        predecessors=tuple(_linked_ids(element, "predecessor", notes)),
        successors=tuple(_linked_ids(element, "successor", notes)),
        reversed=element.get("direction") == "reversed",
    )


def _read_height(element: Element, notes: Findings) -> LaneHeight | None:
    """Read the <height> records of a lane; those that cannot be used are left out."""
    rows: dict[float, tuple[float, float]] = {}
    for record in element.findall("height"):
        try:
            start_m, sides_m = number(record, "sOffset", 0.0), (number(record, "inner"), number(record, "outer"))
        except Malformed as problem:
            notes.left_out("a lane height that cannot be read is ignored", record, str(problem))
            continue
        if max(map(abs, sides_m)) > _MAX_HEIGHT_M:
            notes.left_out(f"a lane height of more than {_MAX_HEIGHT_M:g} m is ignored", record)
            continue
        rows[start_m] = sides_m
    if not rows:
        return None
    starts_m = np.array(sorted(rows))
    return LaneHeight(starts_m, *np.array([rows[start_m] for start_m in starts_m]).T)


def _linked_ids(element: Element, name: str, notes: Findings) -> Iterator[int]:
    for link in element.findall(f"link/{name}"):
        try:
            yield integer_id(link)
        except Malformed as problem:
            notes.left_out("a link of a lane that cannot be read is left out", link, str(problem))


def read_speed(element: Element, notes: Findings) -> float | None:
    """Read a <speed> in m/s; None if it sets no limit or cannot be read."""
    text = element.get("max", "")
    if text in ("no limit", "undefined"):
        return None
    unit_mps = SPEED_UNITS_MPS.get(element.get("unit", "m/s"))
    try:
        speed_mps = number(element, "max") * (unit_mps or 0.0)
    except Malformed:
        speed_mps = 0.0
    if not 0.0 < speed_mps <= _MAX_SPEED_MPS:
        notes.left_out("a speed limit that cannot be read is ignored", element, f"max={text[:20]!r}")
        return None
    return speed_mps


def _read_marks(lane: Element, notes: Findings) -> tuple[tuple[float, Line], ...]:
    """Read the paint on a lane's outer border, by distance from the section's start; none before the first mark."""
    marks: dict[float, Line] = {}
    for mark in lane.findall("roadMark"):
        try:
            marks[start_of(mark, "sOffset", notes, is_optional=True)] = _read_mark(mark, notes)
        except Malformed as problem:
            notes.left_out("a road mark that cannot be read is left out", mark, str(problem))
    return tuple(sorted(marks.items(), key=lambda mark: mark[0]))


def _read_mark(mark: Element, notes: Findings) -> Line:
    """Read one <roadMark>."""
    kind = mark.get("type", "none")
    paint = _custom_paint(mark) if kind == "custom" else _look_up(PAINTS, kind, Paint.NONE, mark, notes)
    weight = PAINT_WIDTHS_M.get(mark.get("weight", "standard"), PAINT_WIDTHS_M["standard"])
    inner = mark.find("type")
    stated = next((e.get("width") for e in (mark, inner) if e is not None and e.get("width") is not None), None)
    try:
        width_m = float(stated or 0.0)
    except ValueError:
        width_m = 0.0
    color = _look_up(PAINT_COLORS, mark.get("color", "standard"), PAINT_COLORS["standard"], mark, notes)
    return Line(paint, color, width_m if 0.0 < width_m <= _MAX_PAINT_WIDTH_M else weight)


def _custom_paint(mark: Element) -> Paint:
    """Paint of a road mark that is described line by line."""
    lines = sorted(mark.findall("type/line"), key=lambda line: -number(line, "tOffset", 0.0))
    words = ["broken" if number(line, "space", 0.0) > 0.0 else "solid" for line in lines[:2]]
    return Paint(" ".join(words)) if words else Paint.NONE


def _look_up(table: Mapping[str, _T], name: str, default: _T, mark: Element, notes: Findings) -> _T:
    """Look up a name in a table; adds a note and returns the default if it is unknown."""
    if name not in table:
        notes.repaired("an unknown kind or color of road mark", mark, repr(name[:30]))
    return table.get(name, default)
