"""Lays out where vehicles park off the streets: lots with painted bays, and the drives of houses."""

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.assets.land.covers import BAY_LINE, PAINT_RISE_M, PATH_RISE_M
from simbev_ros.assets.land.rows import Site
from simbev_ros.assets.land.yard import ENTRANCE_M, Bay, Yard, quad, yaw_of
from simbev_ros.foundation.geometry.plan_view import left_of
from simbev_ros.foundation.types import Float64Array

_BAY_M, _BAY_DEPTH_M, _AISLE_M, _RIM_M = 2.6, 5.0, 6.4, 0.8
_LINE_M = 0.12
DRIVE_M = 3.2
"""Width of the drive of a house."""

_MIN_CAR_M, _CAR_M, _MARGIN_M = 4.4, 5.4, 0.6
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
        rows_m = (y_m, y_m + _BAY_DEPTH_M), (y_m + MODULE_M - _BAY_DEPTH_M, y_m + MODULE_M)
        for (low_m, high_m), outward in zip(rows_m, (-left_of(along), left_of(along)), strict=True):
            x_m = _RIM_M + np.arange(bays + 1) * _BAY_M
            for middle_m in (x_m[:-1] + _BAY_M / 2.0).tolist():
                center_m = origin_m + middle_m * along + (low_m + high_m) / 2.0 * left_of(along)
                yard.bays.append(Bay(center_m, yaw_of(outward), _BAY_DEPTH_M, _BAY_M - _LINE_M))
            lines += [quad(origin_m, along, (x - _LINE_M / 2, x + _LINE_M / 2), (low_m, high_m)) for x in x_m.tolist()]
    if lines:
        yard.cover(shapely.MultiPolygon(lines), BAY_LINE, rise_m=PAINT_RISE_M)
    return True


def add_drive(yard: Yard, site: Site, x_m: float, end_m: float) -> None:
    """Add the bays of a drive, one behind the other, from an end to the sidewalk: both in the frame of a building."""
    span_m = x_m - DRIVE_M / 2.0, x_m + DRIVE_M / 2.0
    yard.entrances.append(site.quad(span_m, (site.street_m - ENTRANCE_M, site.street_m)))
    length_m = end_m - site.street_m - _MARGIN_M / 2.0
    count = max(1, int(length_m / _CAR_M))
    room_m = min(_CAR_M, length_m / count)
    for number in range(count if room_m > _MIN_CAR_M else 0):
        center_m = site.map_point(x_m, end_m - (number + 0.5) * room_m)
        yard.bays.append(Bay(center_m, site.yaw_rad + np.pi / 2.0, room_m, DRIVE_M - _MARGIN_M, is_drive=True))
