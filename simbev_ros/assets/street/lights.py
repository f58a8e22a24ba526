"""Street lights along curbs and verges, masts along motorways; those on structures stand on the deck's rim."""

from collections.abc import Iterator, Sequence

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.assets.land.yard import Yard
from simbev_ros.assets.materials import Material
from simbev_ros.assets.static_scene import StreetLight
from simbev_ros.assets.street.curbs import CurbLine
from simbev_ros.assets.street.poles import MAST_LAMP_AT_M, STREET_LAMP_AT_M, mast, street_light, with_lamp_index
from simbev_ros.assets.tiles import standing
from simbev_ros.geometry.transforms import apply
from simbev_ros.types import Float64Array

_STAGGER = 0.9
_MAST_SPACING = 1.6
_ROOM_M = 0.3


def put_lights(yard: Yard, curbs: Sequence[CurbLine], fast: BaseGeometry) -> Iterator[StreetLight]:
    """Lights of a region, staggered on the two sides: each keeps a distance from those across the street too.

    Args:
        yard: The region.
        curbs: Its lines.
        fast: Where motorways are.
    """
    occupied = np.empty((0, 3))
    shapely.prepare(fast)
    for curb in curbs:
        spacing_m = curb.recipe.street_light_spacing_m
        if spacing_m == 0.0 or len(curb.place_m) == 0:
            continue
        is_fast = bool(shapely.intersects_xy(fast, *curb.place_m[len(curb.place_m) // 2]))
        mesh, lamp_at_m = (mast(), MAST_LAMP_AT_M) if is_fast else (street_light(), STREET_LAMP_AT_M)
        apart_m = _STAGGER * spacing_m * (_MAST_SPACING if is_fast else 1.0)
        for k in _spaced(curb.place_m, occupied[occupied[:, 2] == curb.level, :2], apart_m, yard, curb.level):
            place_m = curb.place_m[k]
            pose = standing(place_m, _foot_m(yard, curb, place_m), float(curb.yaw_rad[k]))
            yard.tiles.place(with_lamp_index(mesh, (Material.STREET_LAMP,), len(occupied)), pose, curb.level)
            occupied = np.concatenate([occupied, [[*place_m, curb.level]]])
            x_m, y_m, z_m = apply(pose, np.array([lamp_at_m]))[0]
            yield StreetLight((float(x_m), float(y_m), float(z_m)))


def _spaced(place_m: Float64Array, occupied_m: Float64Array, apart_m: float, yard: Yard, level: int) -> Iterator[int]:
    """Which places of a line are taken, from its start on: free ones as far as wanted from all taken before."""
    near = shapely.STRtree(np.array(shapely.points(occupied_m)).reshape(-1))
    close, _ = near.query(shapely.points(place_m), predicate="dwithin", distance=apart_m)
    open_ = np.full(len(place_m), True)
    open_[close] = False
    last_m = None
    for k in np.flatnonzero(open_).tolist():
        if last_m is not None and float(np.hypot(*(place_m[k] - last_m))) < apart_m:
            continue
        disc = shapely.Point(place_m[k]).buffer(_ROOM_M, quad_segs=2)
        if level == 0 and not yard.claims.claim(disc):
            continue
        last_m = place_m[k]
        yield k


def _foot_m(yard: Yard, curb: CurbLine, place_m: Float64Array) -> float:
    """Height of what a light stands on."""
    ground, xy_m = yard.ground, place_m[None]
    if curb.level:
        return float(ground.road_m(xy_m, curb.level)[0])
    return float((ground.sidewalk_m(xy_m) if curb.walk else ground.land_m(xy_m))[0])
