"""Writes the map expansion of a site, nuScenes' vector map of version 1.3, as the devkit's ``NuScenesMap`` reads it.

A site enters; ``maps/expansion/NAME.json`` leaves, NAME being the location in the table ``log``. Coordinates are those
of the tables. Areas end at the site's borders; lanes are whole, so they may reach beyond. It has all levels of roads.
"""

import json
import math
from glob import escape
from pathlib import Path
from typing import Any

import numpy as np

from simbev_exporters.nuscenes.map_expansion.canvas import SPECK_M2, Canvas, outline
from simbev_exporters.nuscenes.map_expansion.dividers import divider_layers
from simbev_exporters.nuscenes.map_expansion.lanes import lane_layers, road_blocks
from simbev_exporters.nuscenes.map_expansion.road_areas import RoadAreas
from simbev_exporters.nuscenes.map_expansion.traffic_control import signals_by_strip, stop_lines, traffic_lights
from simbev_exporters.nuscenes.map_masks import network_of
from simbev_exporters.nuscenes.sites import Site
from simbev_exporters.nuscenes.taxonomy import Record
from simbev_ros import __version__
from simbev_ros.export.parts import Part
from simbev_ros.foundation.geometry.plan_view import polygon_parts
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.lane_strips import LaneStrips
from simbev_ros.maps.roads.layout import Layout
from simbev_ros.maps.roads.surface import surfaces_of

FOLDER = "maps/expansion"
"""Folder of the map expansions."""

_VERSION = "1.3"
_DEPENDENCY_M = 20.0
"""Distance within which lanes decide about the paint in the site."""


def expansion_part(site: Site, out: Path) -> Part:
    """The map expansion of a site as a part of the export, finished or not."""
    return Part(
        out=out,
        name=f"map.{site.name}",
        identity={"site": site.token, "by": __version__},
        patterns=(f"{FOLDER}/{escape(site.name)}.json",),
    )


def write_expansion(site: Site, out: Path) -> None:
    """Write the map expansion of a site, unless it is finished.

    Raises:
        InputError: The map's roads cannot be built, or the file cannot be written.
    """
    part = expansion_part(site, out)
    if part.record() is None:
        part.begin()
        content = json.dumps(map_expansion(network_of(site), site)).encode()
        part.write(f"{FOLDER}/{site.name}.json", content)
        part.finish({})


def map_expansion(network: RoadNetwork, site: Site) -> dict[str, Any]:
    """The layers of a site's map expansion by name; plain values."""
    canvas, areas = Canvas(site), RoadAreas()
    layout = network.layout.near(canvas.area, _DEPENDENCY_M)
    inside = network.layout.near(canvas.area, 0.0)
    walkways = _add_areas(canvas, areas, layout)
    strips, driven = inside.strips_of(LaneKind.DRIVING), LaneStrips(inside)
    blocks, block_of = road_blocks(canvas, strips, areas)
    rows_of = signals_by_strip(network, driven)
    layers: dict[str, Any] = {
        "drivable_area": areas.drivable_areas,
        "road_segment": areas.segments,
        "road_block": blocks,
        "walkway": walkways,
        "ped_crossing": _crossings(canvas, inside, areas),
        "carpark_area": _parking_lanes(canvas, inside),
        "stop_line": stop_lines(canvas, inside.stop_lines, driven, rows_of, block_of),
        "traffic_light": traffic_lights(canvas, network.signals, rows_of, block_of),
        **lane_layers(canvas, strips),
        **divider_layers(canvas, layout, areas),
    }
    size_m = [high_m - low_m for low_m, high_m in zip(site.low_m, site.high_m, strict=True)]
    head = {"version": _VERSION, "canvas_edge": size_m, "origin_m": list(site.low_m)}
    return {**head, **layers, **canvas.layers()}


def _add_areas(canvas: Canvas, areas: RoadAreas, layout: Layout) -> list[Record]:
    """Add the drivable areas of all levels; return the layer ``walkway``."""
    walkways: list[Record] = []
    for level in layout.levels:
        surfaces = surfaces_of(layout, level, canvas.area)
        areas.add_level(canvas, layout, surfaces, level)
        for area in polygon_parts(surfaces.sidewalk):
            if area.area >= SPECK_M2:
                token = canvas.token("walkway", len(walkways))
                walkways.append({"token": token, "polygon_token": canvas.add_polygon(area)})
    return walkways


def _crossings(canvas: Canvas, layout: Layout, areas: RoadAreas) -> list[Record]:
    return [
        {
            "token": canvas.token("ped_crossing", number),
            "polygon_token": canvas.add_polygon(outline(crosswalk.outline_m)),
            "road_segment_token": areas.segment_at(crosswalk.outline_m.mean(axis=0), crosswalk.level),
        }
        for number, crosswalk in enumerate(layout.crosswalks)
    ]


def _parking_lanes(canvas: Canvas, layout: Layout) -> list[Record]:
    """The layer ``carpark_area``: parking lanes, with the direction in which cars stand."""
    records = []
    for strip in layout.strips_of(LaneKind.PARKING):
        x_m, y_m = (strip.center_m[-1] - strip.center_m[0])[:2].tolist()
        records.append(
            {
                "token": canvas.token("carpark_area", strip.id),
                "polygon_token": canvas.add_polygon(outline(np.concatenate([strip.left_m, strip.right_m[::-1]]))),
                "orientation": round(math.atan2(y_m, x_m), 6),
                "road_block_token": None,
            }
        )
    return records
