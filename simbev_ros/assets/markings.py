"""Paint on the road, as thin decals, and the crosswalk areas that labels count."""

from functools import partial

import shapely

from simbev_ros.assets.materials import Material
from simbev_ros.assets.primitives import Finish, plate
from simbev_ros.assets.tiles import TileBuilder
from simbev_ros.maps.markings import MarkingKind, lane_markings
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.surface import crossing_polygons
from simbev_ros.semantics import Tag

DECAL_HEIGHT_M = 0.005
"""Paint lies so much above the asphalt, which goes on below it."""

_WHITE = Finish(Material.MARKING, Tag.ROAD_LINE, (226, 226, 220))
_YELLOW = Finish(Material.MARKING, Tag.ROAD_LINE, (224, 176, 48))
_CROSSWALK = Finish(Material.PLAIN, Tag.ROAD, (255, 255, 255))


def paint_markings(tiles: TileBuilder, network: RoadNetwork, road: shapely.MultiPolygon) -> None:
    """Add all paint, and the surface ``crosswalk``, to the tiles."""
    markings = lane_markings(network)
    for finish, yellow in ((_WHITE, False), (_YELLOW, True)):
        polygons = [mark.polygon for mark in markings if (mark.kind is MarkingKind.CENTER) is yellow]
        paint = shapely.intersection(shapely.union_all(polygons), road)
        tiles.cover(paint, partial(plate, finish, z_m=DECAL_HEIGHT_M))
    crosswalks = shapely.union_all(list(crossing_polygons(network)))
    tiles.cover(crosswalks, partial(plate, _CROSSWALK, z_m=0.0), surface="crosswalk")
