"""Lays out parking lots: asphalt with painted bays."""

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.assets.land.covers import BAY_LINE, PAINT_RISE_M, PATH_RISE_M
from simbev_ros.assets.land.yard import Yard, quad
from simbev_ros.foundation.types import Float64Array

_BAY_M, _BAY_DEPTH_M, _AISLE_M, _RIM_M = 2.6, 5.0, 6.4, 0.8
_LINE_M = 0.12
MODULE_M = 2 * _BAY_DEPTH_M + _AISLE_M
"""Depth of two rows of bays with the aisle between them."""


def parking_lot(
    yard: Yard, origin_m: Float64Array, along: Float64Array, width_m: float, depth_m: float, land: BaseGeometry
) -> bool:
    """Lay out a lot on a rectangle, from a (2,) corner along its front and to the left of it, if all of it is free.

    Returns:
        Whether the rectangle was free.
    """
    area = quad(origin_m, along, (0.0, width_m), (0.0, depth_m))
    if not yard.claim(area, land):
        return False
    yard.cover(area, "asphalt", rise_m=PATH_RISE_M)
    bays, modules = int((width_m - 2 * _RIM_M) / _BAY_M), int((depth_m - 2 * _RIM_M) / MODULE_M)
    lines = []
    for module in range(modules):
        y_m = _RIM_M + module * MODULE_M
        for low_m, high_m in ((y_m, y_m + _BAY_DEPTH_M), (y_m + MODULE_M - _BAY_DEPTH_M, y_m + MODULE_M)):
            x_m = _RIM_M + np.arange(bays + 1) * _BAY_M
            lines += [quad(origin_m, along, (x - _LINE_M / 2, x + _LINE_M / 2), (low_m, high_m)) for x in x_m.tolist()]
    if lines:
        yard.cover(shapely.MultiPolygon(lines), BAY_LINE, rise_m=PAINT_RISE_M)
    return True
