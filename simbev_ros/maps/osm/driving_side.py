"""Finds out on which side of the road traffic drives at a place on Earth."""

from functools import cache

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.tables import load_table


def keeps_left(longitude_deg: float, latitude_deg: float) -> bool:
    """Whether traffic keeps to the left at a position; borders are right to about 2 km."""
    longitude_deg = (longitude_deg + 180.0) % 360.0 - 180.0
    return bool(shapely.contains_xy(_left_hand_area(), longitude_deg, latitude_deg))


@cache
def _left_hand_area() -> BaseGeometry:
    """Countries and territories where traffic keeps to the left, with the sea around them, in degrees."""
    outlines = load_table("simbev_ros.maps.osm", "left_hand_areas.yaml")
    inside, outside = (shapely.MultiPolygon(list(map(_polygon, outlines[side]))) for side in ("inside", "outside"))
    return overlay.difference(inside, outside)


def _polygon(outline: str) -> shapely.Polygon:
    return shapely.Polygon(np.array(outline.split(), float).reshape(-1, 2))
