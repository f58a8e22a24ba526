"""Draws the masks of maps that nuScenes' devkit reads: white on streets and sidewalks, 0.1 m per pixel.

``Site``s enter; their PNG files leave. Roads are built from the map files in bags, which needs the simulator.
"""

from pathlib import Path

import cv2
import numpy as np
import shapely

from simbev_exporters.nuscenes.sites import PIXELS_PER_M, Site
from simbev_exporters.recorded_roads import recorded_roads
from simbev_ros.foundation.files.whole_files import write_whole
from simbev_ros.foundation.types import UInt8Array
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.roads.surface import surfaces_of

_WHITE = 255
_FRACTION_BITS = 4


def write_mask(site: Site, out: Path) -> None:
    """Draw and write the mask of a site, unless its file exists.

    Raises:
        InputError: The map's roads cannot be built.
    """
    path = out / site.filename
    if path.exists():
        return
    _, data = cv2.imencode(".png", draw_mask(network_of(site), site))
    write_whole(path, data.tobytes())


def network_of(site: Site) -> RoadNetwork:
    """The road network of a site.

    Raises:
        InputError: The map's roads cannot be built.
    """
    return recorded_roads(Path(site.bag))


def draw_mask(network: RoadNetwork, site: Site) -> UInt8Array:
    """Mask of a site: (H, W) uint8, 255 on roads, shoulders and sidewalks of all levels; row 0 is in the north.

    Column c is at ``low_m[0] + 0.1 c``, row r at ``low_m[1] + 0.1 (H - r)``, as the devkit looks positions up.
    """
    width_px, height_px = site.size_px
    mask = np.zeros((height_px, width_px), np.uint8)
    for level in network.layout.levels:
        surfaces = surfaces_of(network.layout, level, shapely.box(*site.low_m, *site.high_m))
        for surface in (surfaces.road, surfaces.shoulder, surfaces.sidewalk):
            for polygon in surface.geoms:
                _fill_polygon(mask, polygon, site)
    return mask


def _fill_polygon(mask: UInt8Array, polygon: shapely.Polygon, site: Site) -> None:
    rings = []
    for ring in (polygon.exterior, *polygon.interiors):
        corners_px = (np.array(ring.coords)[:, :2] - site.low_m) * PIXELS_PER_M
        corners_px[:, 1] = len(mask) - corners_px[:, 1]
        rings.append(np.rint(corners_px * 2**_FRACTION_BITS).astype(np.int32))
    cv2.fillPoly(mask, rings, _WHITE, cv2.LINE_8, _FRACTION_BITS)
