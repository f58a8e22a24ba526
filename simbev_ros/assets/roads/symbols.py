"""Arrows and words that are painted on lanes, and bicycles on cycle lanes, as areas in plan view."""

from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.assets.placement.region_ground import MARGIN_M, RegionGround
from simbev_ros.assets.street.lettering import glyph
from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.geometry.plan_view import left_of
from simbev_ros.foundation.random import stream
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import Strip

_BEFORE_END_M = (13.0, 36.0)  # from the foot of an arrow to the end of its lane
_TURN_RAD = np.radians(35.0)
_MIN_LENGTH_M, _WORD_AT_M, _BICYCLE_SPACING_M = 45.0, 18.0, 45.0
_ARROWS_SHARE, _WORD_SHARE = 0.3, 0.12
_WORDS = ("SLOW", "SCHOOL", "SLOW")
_LETTER_M, _LETTER_LENGTH_M = 0.34, 2.0
# Lines of arrows in lane coordinates, x ahead and y left, from their foot; a head ends each of them.
_SHAFTS_M: Mapping[int, Float64Array] = {
    0: np.array([[0.0, 0.0], [3.4, 0.0]]),
    1: np.array([[0.0, 0.0], [2.0, 0.0], [3.0, 0.45]]),
    -1: np.array([[0.0, 0.0], [2.0, 0.0], [3.0, -0.45]]),
}
_HEAD_M, _HEAD_HALF_M, _PEN_M = 1.2, 0.42, 0.075
_WHEEL_M = 0.3
_FRAME_M = ((0.0, -0.45, 0.6, 0.0, 0.0, 0.45), (0.6, 0.0, 0.6, -0.35, 0.0, -0.1, 0.6, -0.35, 0.75, -0.45))


def lane_symbols(ground: RegionGround, level: int) -> Iterator[BaseGeometry]:
    """Painted areas of a level in a region, map frame; those across its border are in both regions."""
    layout = ground.network.layout.near(ground.region.area, MARGIN_M)
    by_lane = {strip.lane: strip for strip in layout.strips}
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
            yield in_map(word(_WORDS[int(rng.integers(len(_WORDS)))]), line, _WORD_AT_M)


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
    return _pen([shaft], _PEN_M).union(head)


@lru_cache(maxsize=1)
def _bicycle() -> BaseGeometry:
    wheels = [shapely.Point(0.0, y_m).buffer(_WHEEL_M, quad_segs=3).exterior.buffer(0.04) for y_m in (-0.45, 0.45)]
    return overlay.union_all([*wheels, _pen([np.array(row).reshape(-1, 2) for row in _FRAME_M], 0.04)])


@lru_cache(maxsize=8)
def word(text: str) -> BaseGeometry:
    """A word that drivers read: its letters are stretched along the lane."""
    scale = np.array([_LETTER_M / 4.0, _LETTER_LENGTH_M / 6.0])
    lines = [
        (line * scale + [(number - (len(text) - 1) / 2.0) * 1.4 * _LETTER_M - _LETTER_M / 2.0, 0.0]) @ _READ_ALONG
        for number, letter in enumerate(text)
        for line in glyph(letter)
    ]
    return _pen(lines, 0.06)


_READ_ALONG = np.array([[0.0, -1.0], [1.0, 0.0]])
"""From letters, x to the right and y up, to lane coordinates: up is ahead, right is against y."""


def _pen(lines: Sequence[Float64Array], half_m: float) -> BaseGeometry:
    strokes = [shapely.LineString(line).buffer(half_m, cap_style="square", join_style="mitre") for line in lines]
    return overlay.union_all(strokes)


def in_map(area: BaseGeometry, line: shapely.LineString, at_m: float) -> BaseGeometry:
    """An area in lane coordinates, with its foot at a distance along a lane."""
    foot_m, ahead_m = (shapely.get_coordinates(line.interpolate(s_m))[0] for s_m in (at_m, at_m + 2.0))
    along = (ahead_m - foot_m) / max(float(np.hypot(*(ahead_m - foot_m))), 1e-9)
    return shapely.transform(area, lambda xy: foot_m + xy[:, :1] * along + xy[:, 1:] * left_of(along))
