"""Lines that are painted along curbs where nobody may stop: double or single, as from street to street."""

from collections import defaultdict
from collections.abc import Iterator

import numpy as np
import shapely

from simbev_ros.assets.placement.region_ground import MARGIN_M, RegionGround
from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.random import stream
from simbev_ros.foundation.types import AnyArray
from simbev_ros.maps.roads.bands import Border, painted_bands
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import Paint, PaintColor

_STYLES = (
    (0.45, Paint.NONE, PaintColor.WHITE),
    (0.35, Paint.SOLID_SOLID, PaintColor.YELLOW),
    (0.15, Paint.SOLID, PaintColor.YELLOW),
    (0.05, Paint.SOLID, PaintColor.WHITE),
)
_WIDTH_M, _INSET_M = 0.075, 0.3  # TSRGD 2016, diagrams 1017 and 1018.1: lines of 75 mm, 250 mm from the curb
_CLEAR_M = 1.2  # of crosswalks and stop lines


def curb_paint(ground: RegionGround, level: int) -> Iterator[tuple[PaintColor, AnyArray]]:
    """Painted areas of a level along the sidewalks of a region, map frame, by color."""
    layout = ground.network.layout.near(ground.region.area, MARGIN_M)
    by_lane = {strip.lane: strip for strip in layout.strips}
    shares = np.cumsum([share for share, _, _ in _STYLES])
    borders = defaultdict(list)
    for strip in layout.strips_of(LaneKind.DRIVING, level=level):
        drawn = stream(ground.network.seed, f"curb_paint.{strip.road}").random()
        _, paint, color = _STYLES[int(np.searchsorted(shares, drawn))]
        if paint is Paint.NONE or strip.junction:
            continue
        for along_m, line, name, outward in (
            (strip.left_m, strip.left_line, strip.left, 1.0),
            (strip.right_m, strip.right_line, strip.right, -1.0),
        ):
            beside_walk = name in by_lane and by_lane[name].kind is LaneKind.SIDEWALK
            if beside_walk and line.paint in (Paint.NONE, Paint.CURB):
                borders[color].append(Border(along_m, paint, _WIDTH_M, outward, _INSET_M))
    stops = [shapely.LineString(line.ends_m[:, :2]) for line in layout.stop_lines if line.level == level]
    crossing = overlay.union_all([ground.streets[level].crosswalk, *stops])
    clear = shapely.buffer(crossing, _CLEAR_M, quad_segs=2)
    for color, lines in borders.items():
        areas = overlay.intersection(painted_bands(lines)[1], ground.region.area)
        yield color, overlay.difference(areas, clear)
