"""The surface that things beside a road stand on."""

import shapely

from simbev_ros.assets.placement.region_ground import RegionGround
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.roads.lane_kind import CURB_HEIGHT_M


def surface_m(ground: RegionGround, xy_m: Float64Array, level: int) -> Float64Array:
    """(N,) height of what one stands on at (N, 2) points of a level: sidewalk, road or land."""
    if level:
        return ground.road_m(xy_m, level)
    streets = ground.streets[0]
    height_m = ground.land_m(xy_m)
    on_street = shapely.contains_xy(streets.area, xy_m)
    raised = shapely.contains_xy(streets.raised, xy_m)
    height_m[on_street] = ground.road_m(xy_m[on_street]) + CURB_HEIGHT_M * raised[on_street]
    return height_m
