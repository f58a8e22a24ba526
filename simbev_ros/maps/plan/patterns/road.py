"""The road pattern of a town recipe: a single road through given points."""

from typing import Literal

import numpy as np
from pydantic import Field

from simbev_ros.config.base import Model
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.plan.curves import resample, round_corners
from simbev_ros.maps.plan.draft import Draft, DraftRoad
from simbev_ros.maps.plan.lines import VERTEX_SPACING_M, length_m, part, stations_m
from simbev_ros.maps.plan.road_class import NamedRoadClass

PointXY = tuple[float, float]


class Pass(Model):
    """A stretch of a road on another layer, over or under the road that it crosses there."""

    near_m: PointXY = Field(description="its midpoint, on the road or near it")
    length_m: float = Field(80.0, ge=20)
    layer: int = Field(1, ge=-2, le=3)


class Road(Model):
    """A single road through given points."""

    pattern: Literal["road"]
    name: str
    road: NamedRoadClass
    points_m: tuple[PointXY, ...] = Field(min_length=2, description="x, y; one-way roads run along them")
    curve: Literal["arcs", "spline"] = Field("arcs", description="straight with rounded corners, or winding")
    radius_m: float = Field(25.0, gt=0, description="radius of the arcs")
    closed: bool = False
    layer: int = Field(0, ge=-2, le=3)
    elevated_m: float = Field(0.0, ge=0, le=20)
    passes: tuple[Pass, ...] = ()
    signals_m: tuple[PointXY, ...] = Field((), description="junctions that have traffic lights regardless of the rule")


def draw_road(pattern: Road, draft: Draft, rng: np.random.Generator) -> None:
    """Append the road, divided where its layer changes; does not use ``rng``."""
    points_m = np.array(pattern.points_m)
    if pattern.curve == "spline":
        line_m = spline_through(points_m, pattern.closed)
    else:
        line_m = round_corners(points_m, pattern.radius_m, pattern.closed)
    draft.signals_m.extend(np.array(point) for point in pattern.signals_m)
    for index, (piece_m, layer) in enumerate(_pieces(pattern, line_m)):
        name = pattern.name if not pattern.passes else f"{pattern.name}-{index}"
        draft.roads.append(DraftRoad(name, pattern.road, piece_m, layer, pattern.elevated_m))


def spline_through(points_m: Float64Array, closed: bool = False) -> Float64Array:
    """A smooth line through points, with evenly spaced vertices."""
    from scipy.interpolate import CubicSpline  # takes long to load, and a recipe can be read without it

    if closed:
        points_m = np.concatenate([points_m, points_m[:1]])
    along_m = stations_m(points_m)
    curve = CubicSpline(along_m, points_m, bc_type="periodic" if closed else "natural")
    fine_m: Float64Array = curve(np.linspace(0.0, along_m[-1], max(2, int(along_m[-1]))))
    return resample(fine_m, VERTEX_SPACING_M)


def _pieces(pattern: Road, line_m: Float64Array) -> list[tuple[Float64Array, int]]:
    """The line cut where passes begin and end, with the layer of each piece."""
    whole_m = length_m(line_m)
    along_m = stations_m(line_m)
    bounds: list[tuple[float, int]] = [(0.0, pattern.layer)]
    spans = []
    for pass_ in pattern.passes:
        middle_m = along_m[int(np.argmin(np.linalg.norm(line_m - np.array(pass_.near_m), axis=1)))]
        spans.append((middle_m - pass_.length_m / 2.0, middle_m + pass_.length_m / 2.0, pass_.layer))
    for start_m, end_m, layer in sorted(spans):
        bounds += [(max(start_m, 0.0), layer), (min(end_m, whole_m), pattern.layer)]
    ends_m = [start_m for start_m, _ in bounds[1:]] + [whole_m]
    return [
        (part(line_m, start_m, end_m), layer)
        for (start_m, layer), end_m in zip(bounds, ends_m, strict=True)
        if end_m - start_m > VERTEX_SPACING_M
    ]
