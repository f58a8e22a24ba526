"""Divides the carriageways of a site into nuScenes' road segments: intersections, and the stretches between them.

A layout enters; polygons in the map frame leave. The drivable area is the carriageway with bicycle and parking lanes,
like ``road`` in bird's-eye-view labels. An intersection is the part of it that a junction's lanes cover, with rounded
corners; what remains falls into stretches. Together they cover the drivable area, except for specks.
"""

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_exporters.nuscenes.map_expansion.canvas import SPECK_M2, Canvas
from simbev_exporters.nuscenes.taxonomy import Record
from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.geometry.plan_view import polygon_parts
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.roads.lane_kind import ROAD_KINDS
from simbev_ros.maps.roads.layout import Layout, Strip
from simbev_ros.maps.roads.surface import Surfaces, strip_polygons

_MIN_CLOSING_M = 0.3
_GRID_M = 0.001
_MIN_SEGMENT_M2 = 0.5


@dataclass(slots=True)
class RoadAreas:
    """The records of drivable areas and road segments, and where each segment is.

    Attributes:
        drivable_areas: Records of the layer ``drivable_area``, one for each connected area.
        segments: Records of the layer ``road_segment``.
    """

    drivable_areas: list[Record] = field(default_factory=list)
    segments: list[Record] = field(default_factory=list)
    _shapes: dict[int, list[tuple[shapely.Polygon, str]]] = field(default_factory=lambda: defaultdict(list))

    def add_level(self, canvas: Canvas, layout: Layout, surfaces: Surfaces, level: int) -> None:
        """Add the areas of one level."""
        for area in polygon_parts(surfaces.road):
            if area.area < SPECK_M2:
                continue
            token = canvas.token("drivable_area", len(self.drivable_areas))
            self.drivable_areas.append({"token": token, "polygon_tokens": [canvas.add_polygon(area)]})
            crossings = list(_intersections(layout, level, area))
            stretches = polygon_parts(overlay.difference(area, overlay.union_all(crossings), grid_size=_GRID_M))
            self._add_segments(canvas, crossings, token, level, is_intersection=True)
            self._add_segments(canvas, stretches, token, level, is_intersection=False)

    def segment_at(self, point_m: Float64Array, level: int) -> str | None:
        """Token of the road segment at or nearest to a position on a level; None: there is none."""
        shapes = self._shapes[level]
        if not shapes:
            return None
        distance_m = shapely.distance(np.array([shape for shape, _ in shapes], object), shapely.Point(point_m[:2]))
        return shapes[int(distance_m.argmin())][1]

    def _add_segments(
        self, canvas: Canvas, areas: Iterable[shapely.Polygon], drivable_area: str, level: int, *, is_intersection: bool
    ) -> None:
        for area in areas:
            if area.area >= _MIN_SEGMENT_M2:
                token = canvas.token("road_segment", len(self.segments))
                record = {"token": token, "polygon_token": canvas.add_polygon(area)}
                self.segments.append(
                    {**record, "is_intersection": is_intersection, "drivable_area_token": drivable_area}
                )
                self._shapes[level].append((area, token))


def _intersections(layout: Layout, level: int, area: shapely.Polygon) -> Iterable[shapely.Polygon]:
    """Parts of a connected area that belong to junctions; none overlaps another."""
    strips: defaultdict[str, list[Strip]] = defaultdict(list)
    for strip in layout.strips_of(*ROAD_KINDS, level=level):
        if strip.junction and not strip.continues:
            strips[strip.junction].append(strip)
    taken: BaseGeometry = shapely.Polygon()
    closing_m = max(layout.corner_radius_m, _MIN_CLOSING_M)
    for members in strips.values():
        covered = _covered(members)
        if not shapely.intersects(covered, area):
            continue
        closed = shapely.buffer(shapely.buffer(covered, closing_m), -closing_m)
        inside = overlay.intersection(overlay.union(closed, covered), area)
        free = overlay.difference(inside, taken, grid_size=_GRID_M)
        taken = overlay.union(taken, free)
        yield from polygon_parts(free)


def _covered(strips: Sequence[Strip]) -> BaseGeometry:
    merged: BaseGeometry = overlay.union_all(strip_polygons(strips))
    return merged
