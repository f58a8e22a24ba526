"""Arrows and words that are painted on lanes, bus stops, and bicycles on cycle lanes, as areas in plan view."""

from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.assets.placement.region_ground import MARGIN_M, RegionGround
from simbev_ros.assets.street.lettering import glyph
from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.geometry.plan_view import left_of
from simbev_ros.foundation.random import stream
from simbev_ros.foundation.tables import load_table
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import Strip
from simbev_ros.maps.roads.surface import strip_polygons

_BEFORE_END_M = (13.0, 36.0)  # from the foot of an arrow to the end of its lane
_TURN_RAD = np.radians(35.0)
_MIN_LENGTH_M, _WORD_AT_M, _BICYCLE_SPACING_M = 45.0, 18.0, 45.0
_ARROWS_SHARE, _WORD_SHARE = 0.3, 0.12
_LETTER_M, _LETTER_LENGTH_M, _LINE_SPACING_M = 0.34, 2.0, 3.0
_BESIDE_WORDS_M = 0.5  # of a lane's width
# Lines of arrows in lane coordinates, x ahead and y left, from their foot; a head ends each of them.
_SHAFTS_M: Mapping[int, Float64Array] = {
    0: np.array([[0.0, 0.0], [3.4, 0.0]]),
    1: np.array([[0.0, 0.0], [2.0, 0.0], [3.0, 0.45]]),
    -1: np.array([[0.0, 0.0], [2.0, 0.0], [3.0, -0.45]]),
}
_HEAD_M, _HEAD_HALF_M, _PEN_M = 1.2, 0.42, 0.075
_WHEEL_M = 0.3
_BUS_LANE_SHARE, _STOP_SHARE = 0.4, 0.35
_MIN_STREET_M, _MAX_SPEED_MPS = 95.0, 17.0
_ENTRY_M, _WORDS_EVERY_M, _EXIT_M = 14.0, 55.0, 46.0  # words keep clear of the arrows at a lane's end
_STOP_FROM_M, _STOP_LENGTH_M, _INSET_M = 28.0, 13.0, 0.62  # inside of the lines along curbs
_HALF_LINE_M, _ZIGZAG_M, _ZIGZAG_WIDTH_M = 0.06, 1.9, 0.75
_FRAME_M = ((0.0, -0.45, 0.6, 0.0, 0.0, 0.45), (0.6, 0.0, 0.6, -0.35, 0.0, -0.1, 0.6, -0.35, 0.75, -0.45))


def lane_symbols(ground: RegionGround, level: int) -> Iterator[BaseGeometry]:
    """Painted areas of a level in a region, map frame; those across its border are in both regions."""
    layout = ground.network.layout.near(ground.region.area, MARGIN_M)
    by_lane = {strip.lane: strip for strip in layout.strips}
    texts = country_words(ground.network)["lane"]
    for strip in layout.strips_of(LaneKind.DRIVING, LaneKind.BICYCLE, level=level):
        line = shapely.LineString(strip.center_m[:, :2])
        if strip.junction or line.length < _MIN_LENGTH_M:
            continue
        rng = stream(ground.network.seed, f"lane_symbols.{strip.id}")
        if strip.kind is LaneKind.BICYCLE:
            for at_m in np.arange(10.0, line.length - 5.0, _BICYCLE_SPACING_M):
                yield in_map(_bicycle(), line, float(at_m))
            continue
        directions = sorted(_directions(strip, [by_lane[name] for name in strip.following if name in by_lane]))
        abreast = any(by_lane[name].kind is LaneKind.DRIVING for name in (strip.left, strip.right) if name in by_lane)
        if directions and (abreast or rng.random() < _ARROWS_SHARE):
            for before_m in _BEFORE_END_M:
                yield in_map(_arrows(tuple(directions)), line, line.length - before_m)
        elif rng.random() < _WORD_SHARE:
            yield in_map(words(tuple(texts[int(rng.integers(len(texts)))]), width_m(strip)), line, _WORD_AT_M)


def bus_paint(ground: RegionGround, level: int) -> Iterator[BaseGeometry]:
    """Painted areas of a level in a region, map frame; those across its border are in both regions."""
    layout = ground.network.layout.near(ground.region.area, MARGIN_M)
    country = country_words(ground.network)
    by_lane = {strip.lane: strip for strip in layout.strips}
    for strip in layout.strips_of(LaneKind.DRIVING, level=level):
        beside = by_lane.get(strip.right)
        line = shapely.LineString(strip.center_m[:, :2])
        if strip.junction or strip.speed_mps > _MAX_SPEED_MPS or beside is None or beside.kind is LaneKind.DRIVING:
            continue
        rng = stream(ground.network.seed, f"bus_paint.{strip.road}.{strip.index > 0}")
        is_bus_lane, has_stop = rng.random(2) < (_BUS_LANE_SHARE, _STOP_SHARE)
        left, arrows = by_lane.get(strip.left), any(n in by_lane and by_lane[n].junction for n in strip.following)
        if is_bus_lane and arrows and left and left.kind is LaneKind.DRIVING and left.left != strip.lane:
            symbol = words(tuple(country["bus"]), width_m(strip))
            places_m = np.arange(_ENTRY_M, line.length - _EXIT_M, _WORDS_EVERY_M)
        elif has_stop and beside.kind is LaneKind.SIDEWALK and line.length > _MIN_STREET_M:
            symbol = _stop(country, width_m(strip))
            places_m = rng.uniform(_STOP_FROM_M, line.length - _EXIT_M - _STOP_LENGTH_M, 1)
        else:
            continue
        lane = shapely.buffer(strip_polygons([strip])[0], 0.01)
        placed = [in_map(symbol, line, float(at_m)) for at_m in places_m]
        yield from (area for area in placed if lane.contains(area))


def _stop(country: dict[str, Any], lane_m: float) -> BaseGeometry:
    """A bus stop at the right border of a lane, in lane coordinates: the word in a box, or beside a zigzag line."""
    half_m = lane_m / 2.0 - _INSET_M
    text = tuple("STOP" if word in ("ONLY", "LANE") else word for word in country["bus"])
    if country["stop"] == "box":
        corners_m = np.array([[0, -1], [1, -1], [1, 1], [0, 1], [0, -1]]) * [_STOP_LENGTH_M, half_m]
        word = words(text, 2.0 * half_m)
        foot_m = np.array([(_STOP_LENGTH_M - word.bounds[2]) / 2.0, 0.0])
    else:
        along_m = np.arange(0.0, _STOP_LENGTH_M, _ZIGZAG_M)
        corners_m = np.column_stack([along_m, _ZIGZAG_WIDTH_M * (np.arange(len(along_m)) % 2) - half_m])
        word = words(text, 2.0 * half_m - _ZIGZAG_WIDTH_M)
        foot_m = np.array([_STOP_LENGTH_M / 2.0 - 1.0, _ZIGZAG_WIDTH_M / 2.0 + 0.1])
    return overlay.union(pen([corners_m], _HALF_LINE_M), shapely.transform(word, lambda xy: xy + foot_m))


def country_words(network: RoadNetwork) -> dict[str, Any]:
    """The row of lane_words.yaml for the country that a map lies in."""
    latitude_deg, longitude_deg = network.datum.latitude_deg, network.datum.longitude_deg
    found: dict[str, Any] = {}
    for row in load_table("simbev_ros.assets.roads", "lane_words.yaml"):
        if row["south"] <= latitude_deg <= row["north"] and row["west"] <= longitude_deg <= row["east"]:
            found = row
    return found


def width_m(strip: Strip) -> float:
    """Width of a lane where it is narrowest."""
    return float(np.hypot(*(strip.left_m - strip.right_m)[:, :2].T).min())


def _directions(strip: Strip, following: Sequence[Strip]) -> set[int]:
    """Where the lanes that follow lead: 1 left, 0 ahead, -1 right."""
    turns = [_heading(after.center_m[-2:]) - _heading(strip.center_m[-2:]) for after in following if after.junction]
    turns = [(turn + np.pi) % (2.0 * np.pi) - np.pi for turn in turns]
    return {int(np.sign(turn)) if abs(turn) > _TURN_RAD else 0 for turn in turns}


def _heading(line_m: Float64Array) -> float:
    return float(np.arctan2(*(line_m[-1, :2] - line_m[0, :2])[::-1]))


@lru_cache(maxsize=8)
def _arrows(directions: tuple[int, ...]) -> BaseGeometry:
    return overlay.union_all([arrow(direction) for direction in directions])


def arrow(direction: int) -> BaseGeometry:
    """An arrow to the left (1), ahead (0) or to the right (-1), in lane coordinates: x ahead, y left."""
    shaft = _SHAFTS_M[direction]
    along = (shaft[-1] - shaft[-2]) / np.linalg.norm(shaft[-1] - shaft[-2])
    aside = left_of(along) * _HEAD_HALF_M
    head = shapely.Polygon([shaft[-1] - aside, shaft[-1] + along * _HEAD_M, shaft[-1] + aside])
    return pen([shaft], _PEN_M).union(head)


@lru_cache(maxsize=1)
def _bicycle() -> BaseGeometry:
    wheels = [shapely.Point(0.0, y_m).buffer(_WHEEL_M, quad_segs=3).exterior.buffer(0.04) for y_m in (-0.45, 0.45)]
    return overlay.union_all([*wheels, pen([np.array(row).reshape(-1, 2) for row in _FRAME_M], 0.04)])


@lru_cache(maxsize=64)
def words(texts: tuple[str, ...], lane_m: float = np.inf) -> BaseGeometry:
    """Words that drivers of a lane of a width read, the farthest first: their letters are stretched along the lane."""
    letter_m = min(_LETTER_M, (lane_m - _BESIDE_WORDS_M) / (1.4 * max(map(len, texts))))
    scale = np.array([letter_m / 4.0, _LETTER_LENGTH_M / 6.0])
    lines = [
        (line * scale + [(number - (len(text) - 1) / 2.0) * 1.4 * letter_m - letter_m / 2.0, row * _LINE_SPACING_M])
        @ _READ_ALONG
        for row, text in enumerate(reversed(texts))
        for number, letter in enumerate(text)
        for line in glyph(letter)
    ]
    return pen(lines, 0.06)


_READ_ALONG = np.array([[0.0, -1.0], [1.0, 0.0]])
"""From letters, x to the right and y up, to lane coordinates: up is ahead, right is against y."""


def pen(lines: Sequence[Float64Array], half_m: float) -> BaseGeometry:
    """Area of strokes along (N, 2) lines, of half a width."""
    strokes = [shapely.LineString(line).buffer(half_m, cap_style="square", join_style="mitre") for line in lines]
    return overlay.union_all(strokes)


def in_map(area: BaseGeometry, line: shapely.LineString, at_m: float) -> BaseGeometry:
    """An area in lane coordinates, with its foot at a distance along a lane."""
    foot_m, ahead_m = (shapely.get_coordinates(line.interpolate(s_m))[0] for s_m in (at_m, at_m + 2.0))
    along = (ahead_m - foot_m) / max(float(np.hypot(*(ahead_m - foot_m))), 1e-9)
    return shapely.transform(area, lambda xy: foot_m + xy[:, :1] * along + xy[:, 1:] * left_of(along))
