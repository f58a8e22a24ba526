"""Builds road markings as thin decals that follow the asphalt."""

from collections import defaultdict
from collections.abc import Iterator
from functools import partial

import numpy as np
import shapely

from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.drape import Rise, cover_mesh
from simbev_ros.assets.mesh.primitives import Finish
from simbev_ros.assets.placement.region_ground import RegionGround
from simbev_ros.assets.placement.tiles import TileBuilder
from simbev_ros.assets.roads.curb_paint import curb_paint
from simbev_ros.assets.roads.hatching import hatched_areas
from simbev_ros.assets.roads.symbols import bus_paint, lane_symbols
from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import AnyArray
from simbev_ros.maps.roads.layout import PaintColor
from simbev_ros.maps.roads.markings import lane_markings

DECAL_HEIGHT_M = 0.005
"""Height of paint above the asphalt, which continues below it."""

_COLORS = {
    PaintColor.WHITE: (226, 226, 220),
    PaintColor.YELLOW: (224, 176, 48),
    PaintColor.BLUE: (52, 92, 164),
    PaintColor.GREEN: (58, 128, 84),
    PaintColor.RED: (168, 58, 48),
    PaintColor.ORANGE: (222, 124, 40),
}


def paint_markings(tiles: TileBuilder, ground: RegionGround) -> None:
    """Add the road markings of every level to its tiles."""
    for level, facets in enumerate(ground.facets):
        if facets is None:
            continue
        by_color = defaultdict(list)
        for mark in lane_markings(ground.network.layout, level, ground.region.area):
            by_color[mark.color].append(mark.polygon)
        symbols = [*lane_symbols(ground, level), *bus_paint(ground, level), *hatched_areas(ground, level)]
        within = overlay.intersection(symbols, ground.region.area)
        by_color[PaintColor.WHITE] += [part for part in within if not part.is_empty]
        for color, areas in curb_paint(ground, level):
            by_color[color] += [area for area in areas if not area.is_empty]
        asphalt = overlay.union(ground.streets[level].road, ground.streets[level].shoulder)
        shapely.prepare(asphalt)
        for color, polygons in by_color.items():
            paint = np.array(polygons, object)
            beyond = ~shapely.contains(asphalt, paint)
            paint[beyond] = overlay.intersection(paint[beyond], asphalt)
            finish = Finish(Material.MARKING, Tag.ROAD_LINE, _COLORS[color])
            for area, rise_m in _by_rise(ground, level, paint):
                tiles.drape(area, facets, partial(cover_mesh, finish=finish, rise_m=rise_m), level=level)


def _by_rise(ground: RegionGround, level: int, paint: AnyArray) -> Iterator[tuple[shapely.GeometryCollection, Rise]]:
    """Paint on the carriageway's plane, and paint on lanes that the map raises."""
    lanes = ground.raised[level]
    if lanes:
        on_lanes = overlay.intersection(paint, lanes.area)
        paint = overlay.difference(paint, lanes.area)
        yield shapely.GeometryCollection(list(on_lanes)), lambda xy_m: lanes.nearest_rise_m(xy_m) + DECAL_HEIGHT_M
    yield shapely.GeometryCollection(list(paint)), DECAL_HEIGHT_M
