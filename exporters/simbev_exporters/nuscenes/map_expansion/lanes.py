"""Makes the layers of lanes of a map expansion: lanes, connectors in junctions, their links and paths, road blocks.

Driving strips of a layout enter; records leave. Strips outside junctions are ``lane``s, those inside are
``lane_connector``s. A road block is made of the lanes of one direction that run side by side.
"""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import shapely

from simbev_exporters.nuscenes.map_expansion.arcline_paths import arcline_path
from simbev_exporters.nuscenes.map_expansion.canvas import NODE_GRID_M, Canvas, largest, outline
from simbev_exporters.nuscenes.map_expansion.dividers import divider_segments
from simbev_exporters.nuscenes.map_expansion.road_areas import RoadAreas
from simbev_exporters.nuscenes.taxonomy import Record
from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.geometry.plan_view import polygon_parts
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.lane_links import strip_links
from simbev_ros.maps.roads.layout import Strip
from simbev_ros.maps.roads.surface import strip_polygons

_GAP_M = 0.05
"""Gap between lanes that still run side by side."""


def lane_layers(canvas: Canvas, strips: Sequence[Strip]) -> dict[str, Any]:
    """The layers ``lane``, ``lane_connector``, ``connectivity`` and ``arcline_path_3`` by name.

    Our additions to lanes and connectors are ``simbev_id``, the id of the section in vector map labels, and ``level``.
    """
    tokens = {strip.id: lane_token(canvas, strip) for strip in strips}
    links = zip(tokens.values(), strip_links(strips), strict=True)
    return {
        "lane": [_lane(canvas, strip) for strip in strips if not strip.junction],
        "lane_connector": [_common(canvas, strip) for strip in strips if strip.junction],
        "connectivity": {
            token: {
                "incoming": [tokens[other] for other in found.predecessors],
                "outgoing": [tokens[other] for other in found.successors],
            }
            for token, found in links
        },
        "arcline_path_3": {tokens[strip.id]: arcline_path(canvas.to_global(strip.center_m)) for strip in strips},
    }


def lane_token(canvas: Canvas, strip: Strip) -> str:
    """Token of a lane or lane connector."""
    return canvas.token("lane", strip.id)


def road_blocks(canvas: Canvas, strips: Sequence[Strip], areas: RoadAreas) -> tuple[list[Record], dict[str, str]]:
    """The layer ``road_block``, and the token of the block by id of each strip in one."""
    records, block_of = [], {}
    for members in _side_by_side([strip for strip in strips if not strip.junction]):
        token = canvas.token("road_block", members[0].id)
        middle = members[len(members) // 2].center_m
        records.append(
            {
                "token": token,
                "polygon_token": canvas.add_polygon(_block_area(members)),
                "from_edge_line_token": canvas.add_line(_edge(members, 0)),
                "to_edge_line_token": canvas.add_line(_edge(members, -1)),
                "road_segment_token": areas.segment_at(middle[len(middle) // 2], members[0].level),
            }
        )
        block_of.update(dict.fromkeys((strip.id for strip in members), token))
    return records, block_of


def _common(canvas: Canvas, strip: Strip) -> Record:
    polygon = outline(np.concatenate([strip.left_m, strip.right_m[::-1]]))
    token = canvas.add_polygon(polygon)
    return {
        "token": lane_token(canvas, strip),
        "polygon_token": token,
        "simbev_id": strip.id,
        "level": strip.level,
    }


def _lane(canvas: Canvas, strip: Strip) -> Record:
    return {
        **_common(canvas, strip),
        "lane_type": "CAR",
        "from_edge_line_token": canvas.add_line(_edge([strip], 0)),
        "to_edge_line_token": canvas.add_line(_edge([strip], -1)),
        "left_lane_divider_segments": divider_segments(
            canvas, strip.left_m, strip.left_line.paint, strip.left_line.color
        ),
        "right_lane_divider_segments": divider_segments(
            canvas, strip.right_m, strip.right_line.paint, strip.right_line.color
        ),
    }


def _side_by_side(strips: Sequence[Strip]) -> Iterator[list[Strip]]:
    """Groups of touching strips of one road and direction, each from left to right."""
    groups: defaultdict[tuple[object, ...], list[Strip]] = defaultdict(list)
    for strip in strips:
        groups[strip.road, strip.section, strip.level, strip.index > 0].append(strip)
    for group in groups.values():
        areas = shapely.buffer(strip_polygons(group), _GAP_M)
        parts = polygon_parts(overlay.union_all(areas))
        for part in parts:
            members = [strip for strip, area in zip(group, areas, strict=True) if shapely.intersects(part, area)]
            yield sorted(members, key=lambda strip: abs(strip.index))


def _block_area(strips: Sequence[Strip]) -> shapely.Polygon:
    """Area of strips side by side, with gaps between them closed only where they do not touch."""
    areas = strip_polygons(strips)
    merged = overlay.union_all(areas)
    if len(polygon_parts(merged)) > 1:
        merged = shapely.buffer(overlay.union_all(shapely.buffer(areas, _GAP_M)), -_GAP_M)
    return largest(polygon_parts(shapely.set_precision(merged, NODE_GRID_M)))


def _edge(strips: Sequence[Strip], end: int) -> Float64Array:
    """Corners of strips from left to right, at their start (0) or end (-1)."""
    return np.array([corner for strip in strips for corner in (strip.left_m[end], strip.right_m[end])])
