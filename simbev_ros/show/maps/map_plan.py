"""Draws a map as a plan: land use, relief, water, prescribed buildings, and the roads, from the lowest level upward.

A road network enters; an RGB picture, north up, leaves. Colors come from ``map_plan.yaml``.
"""

from functools import lru_cache

import cv2
import numpy as np
import shapely

from simbev_ros.drawing.canvas import Color
from simbev_ros.foundation.tables import load_table
from simbev_ros.foundation.types import Float32Array, Float64Array, Int32Array, UInt8Array
from simbev_ros.maps.land.terrain import Terrain
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import Strip

_OVERSAMPLING = 2
_TUNNEL_OPACITY = 0.45
_FRACTION_BITS = 4
_MOTORWAY_MPS, _MAIN_ROAD_MPS = 22.0, 15.0
_RELIEF_CELL_PX = 8
_SUN = np.array([-0.5, 0.5, 0.7]) / np.linalg.norm([-0.5, 0.5, 0.7])
_EXAGGERATION = 2.5


class MapPlan:
    """A square plan drawing of a map, north up, to which further marks can be added."""

    def __init__(self, network: RoadNetwork, center_m: Float64Array, extent_m: float, size_px: int) -> None:
        """Draw the plan.

        Args:
            network: The map.
            center_m: (2,) center of the drawing, map frame.
            extent_m: Side of the drawing in meters.
            size_px: Side of the drawing in pixels.
        """
        self._count = size_px * _OVERSAMPLING
        self._size_px = size_px
        self._cell_m = extent_m / self._count
        self._corner_m = np.array([center_m[0] - extent_m / 2.0, center_m[1] + extent_m / 2.0])
        self._canvas = np.empty((self._count, self._count, 3), np.uint8)
        self._draw_land(network)
        strips, tunnels = network.layout.strips, network.layout.tunnel_levels
        if tunnels:
            land = self._canvas.copy()
            self._draw_roads([strip for strip in strips if strip.tunnel])
            self._canvas[:] = cv2.addWeighted(self._canvas, _TUNNEL_OPACITY, land, 1.0 - _TUNNEL_OPACITY, 0.0)
        for level in range(tunnels.start):
            self._draw_roads([strip for strip in strips if strip.level == level])

    def draw_frame(self, center_m: Float64Array, extent_m: float) -> None:
        """Draw the outline of a square.

        Args:
            center_m: (2,) center of the square, map frame.
            extent_m: Side of the square.
        """
        corners_m = center_m + extent_m / 2.0 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
        self._draw_lines([self._pixels(corners_m)], palette()["frame"], 3 * _OVERSAMPLING)

    def picture(self) -> UInt8Array:
        """The drawing as (size_px, size_px, 3) uint8 RGB."""
        picture = cv2.resize(self._canvas, (self._size_px, self._size_px), interpolation=cv2.INTER_AREA)
        return np.asarray(picture, np.uint8)

    def _draw_land(self, network: RoadNetwork) -> None:
        features, colors = network.features, palette()
        self._canvas[:] = colors[features.surroundings.use]
        for zone in features.zones:
            self._fill_area(zone.area, colors[zone.surroundings.use])
        self._canvas[:] = np.clip(self._canvas * self._hill_shade(network)[..., None], 0, 255)
        for water in features.water:
            self._fill_area(water.area, colors["water"])
        for building in features.buildings or ():
            self._fill_area(building.outline, colors["building"])
            self._draw_lines([self._pixels(np.array(building.outline.exterior.coords))], colors["building_line"], 1)

    def _hill_shade(self, network: RoadNetwork) -> Float32Array:
        """(count, count) brightness factor of the relief; exactly 1 on level land."""
        steps = np.arange(0, self._count + _RELIEF_CELL_PX, _RELIEF_CELL_PX) * self._cell_m
        x_m, y_m = np.meshgrid(self._corner_m[0] + steps, self._corner_m[1] - steps)
        height_m = Terrain(network).far_m(np.column_stack([x_m.ravel(), y_m.ravel()])).reshape(x_m.shape)
        south, east = np.gradient(height_m, _RELIEF_CELL_PX * self._cell_m / _EXAGGERATION)
        light = (_SUN[2] - _SUN[0] * east + _SUN[1] * south) / np.sqrt(1.0 + east**2 + south**2)
        factor = np.clip(light / _SUN[2], 0.78, 1.06).astype(np.float32)
        size = self._count + _RELIEF_CELL_PX
        return np.asarray(cv2.resize(factor, (size, size))[: self._count, : self._count], np.float32)

    def _draw_roads(self, strips: list[Strip]) -> None:
        """Draw the roads of one level: first the casing, slightly wider, then the lanes, fast roads last."""
        colors = palette()
        areas = [self._pixels(_ring(strip)) for strip in strips]
        driven = [strip.kind is LaneKind.DRIVING for strip in strips]
        self._draw_lines([area for area, road in zip(areas, driven, strict=True) if road], colors["casing"], 3)
        for strip, area in zip(strips, areas, strict=True):
            if strip.kind is not LaneKind.DRIVING:
                self._fill([area], colors[_NAMES[strip.kind]])
        for name in ("road", "main_road", "motorway"):
            chosen = [k for k, strip in enumerate(strips) if driven[k] and _road_class(strip) == name]
            for k in chosen:  # one by one: overlapping areas in one call would cancel each other
                self._fill([areas[k]], colors[name])
            lines = [self._pixels(strips[k].center_m[:, :2]) for k in chosen]
            self._draw_lines(
                lines, colors[name], _OVERSAMPLING, closed=False
            )  # visible even where lanes are thinner than a pixel

    def _fill_area(self, area: shapely.Polygon, color: Color) -> None:
        self._fill([self._pixels(np.array(ring.coords)) for ring in (area.exterior, *area.interiors)], color)

    def _fill(self, rings: list[Int32Array], color: Color) -> None:
        if rings:
            cv2.fillPoly(self._canvas, rings, color, cv2.LINE_AA, _FRACTION_BITS)

    def _draw_lines(self, lines: list[Int32Array], color: Color, width_px: int, *, closed: bool = True) -> None:
        cv2.polylines(self._canvas, lines, closed, color, width_px, cv2.LINE_AA, _FRACTION_BITS)

    def _pixels(self, xy_m: Float64Array) -> Int32Array:
        """(N, 2) fixed-point columns and rows; clipped far outside the drawing to avoid overflow."""
        pixels = (xy_m - self._corner_m) * (1.0, -1.0) / self._cell_m
        fixed = np.clip(pixels, -8 * self._count, 8 * self._count) * 2**_FRACTION_BITS
        return np.asarray(np.rint(fixed), np.int32)


@lru_cache(maxsize=1)
def palette() -> dict[str, Color]:
    """Colors of the plan by name; those of land by ``SurroundingsRecipe.use``."""
    table = load_table("simbev_ros.show.maps", "map_plan.yaml")
    return {name: (color[0], color[1], color[2]) for name, color in {**table.pop("land"), **table}.items()}


_NAMES = {
    LaneKind.BICYCLE: "bicycle",
    LaneKind.PARKING: "parking",
    LaneKind.SHOULDER: "shoulder",
    LaneKind.MEDIAN: "median",
    LaneKind.SIDEWALK: "sidewalk",
    LaneKind.CROSSING: "sidewalk",
    LaneKind.WALKING_AREA: "sidewalk",
}


def _road_class(strip: Strip) -> str:
    if strip.speed_mps < _MAIN_ROAD_MPS:
        return "road"
    return "motorway" if strip.speed_mps >= _MOTORWAY_MPS else "main_road"


def _ring(strip: Strip) -> Float64Array:
    if strip.outline_m is not None:
        return strip.outline_m
    return np.concatenate([strip.left_m[:, :2], strip.right_m[::-1, :2]])
