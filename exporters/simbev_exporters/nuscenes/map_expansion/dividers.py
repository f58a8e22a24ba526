"""Makes the dividers of a map expansion from painted lines: between lanes of one direction, and between directions.

A layout enters; records leave. nuScenes knows six types; ``dividers.yaml`` has the nearest one of each paint.
"""

from collections.abc import Iterator
from functools import lru_cache
from typing import Any

import numpy as np
import shapely

from simbev_exporters.nuscenes.map_expansion.canvas import Canvas
from simbev_exporters.nuscenes.map_expansion.road_areas import RoadAreas
from simbev_exporters.nuscenes.taxonomy import Record
from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.tables import load_table
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.roads.layout import Layout, Paint, PaintColor
from simbev_ros.maps.roads.line_paths import LinePath, line_paths
from simbev_ros.maps.roads.markings import MarkingKind


def divider_layers(canvas: Canvas, layout: Layout, areas: RoadAreas) -> dict[str, list[Record]]:
    """The layers ``road_divider`` and ``lane_divider`` by name."""
    between_directions: list[Record] = []
    between_lanes: list[Record] = []
    for level in layout.levels:
        for path in line_paths(layout, level):
            for piece_m in _clipped(path, canvas.area):
                match path.kind:
                    case MarkingKind.CENTER:
                        middle_m = piece_m[len(piece_m) // 2]
                        between_directions.append(
                            {
                                "token": canvas.token("road_divider", len(between_directions)),
                                "line_token": canvas.add_line(piece_m),
                                "road_segment_token": areas.segment_at(middle_m, level),
                            }
                        )
                    case MarkingKind.LANE:
                        between_lanes.append(
                            {
                                "token": canvas.token("lane_divider", len(between_lanes)),
                                "line_token": canvas.add_line(piece_m),
                                "lane_divider_segments": divider_segments(canvas, piece_m, path.paint, path.color),
                            }
                        )
                    case _:
                        pass  # edges of roads, which nuScenes has no layer for
    return {"road_divider": between_directions, "lane_divider": between_lanes}


def divider_segments(canvas: Canvas, line_m: Float64Array, paint: Paint, color: PaintColor) -> list[Record]:
    """Type of a divider at each of its (N, 2+) points in the map frame."""
    kind = divider_type(paint, color)
    return [{"node_token": node, "segment_type": kind} for node in canvas.add_nodes(line_m)]


def divider_type(paint: Paint, color: PaintColor) -> str:
    """Type in nuScenes of a divider with a paint and color."""
    kinds = _types()
    if paint.value in kinds["yellow"] and color is PaintColor.YELLOW:
        return str(kinds["yellow"][paint.value])
    return str(kinds["any"][paint.value])


def _clipped(path: LinePath, area: shapely.Polygon) -> Iterator[Float64Array]:
    line = overlay.intersection(shapely.LineString(path.along_m[:, :2]), area)
    for part in shapely.get_parts(line):
        if part.length > 0:
            yield np.asarray(shapely.get_coordinates(part))


@lru_cache(maxsize=1)
def _types() -> dict[str, Any]:
    return load_table("simbev_exporters.nuscenes.map_expansion", "dividers.yaml")
