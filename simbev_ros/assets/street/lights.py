"""Puts street lights along curbs and verges and masts along motorways; on structures they stand on the deck's rim."""

from collections.abc import Iterator, Sequence

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.assets.land.yard import Yard
from simbev_ros.assets.materials import Material
from simbev_ros.assets.placement.ensemble import Base
from simbev_ros.assets.placement.static_scene import StreetLight
from simbev_ros.assets.placement.tiles import upright_pose
from simbev_ros.assets.street.curbs import CurbLine
from simbev_ros.assets.street.light_places import Lanes, light_positions
from simbev_ros.assets.street.poles import MAST_LAMP_AT_M, STREET_LAMP_AT_M, mast, street_light, with_lamp_index
from simbev_ros.foundation.geometry.transforms import apply
from simbev_ros.foundation.types import Float64Array, Int64Array
from simbev_ros.maps.land_features import ObjectKind

_SPACING_OF_A_SIDE = 1.7  # the two sides of a street share its lights
_MAST_SPACING = 1.6
_APART = 0.6  # in spacings: minimum distance from lights of other curbs
_ROOM_M = 0.3


def put_lights(yard: Yard, curbs: Sequence[CurbLine], fast: BaseGeometry, first: int = 0) -> Iterator[StreetLight]:
    """Put the street lights of a region, staggered on the two sides of streets, and yield their light sources.

    Args:
        yard: Region that is laid out.
        curbs: Lines beside its carriageways.
        fast: Area of motorways.
        first: Index of the first light; those of the map come before it.
    """
    occupied = np.empty((0, 3))
    lanes = [Lanes.of_level(yard.ground, level) for level in range(len(yard.ground.streets))]
    shapely.prepare(fast)
    for curb in curbs:
        spacing_m = curb.recipe.street_light_spacing_m
        if spacing_m == 0.0 or len(curb.position_m) == 0:
            continue
        is_fast = bool(shapely.intersects_xy(fast, *curb.position_m[len(curb.position_m) // 2]))
        mesh, lamp_at_m = (mast(), MAST_LAMP_AT_M) if is_fast else (street_light(), STREET_LAMP_AT_M)
        spacing_m *= _MAST_SPACING if is_fast else 1.0
        for choice in light_positions(yard.ground, curb, lanes[curb.level], _SPACING_OF_A_SIDE * spacing_m):
            k = _first_free(yard, curb, choice, occupied[occupied[:, 2] == curb.level, :2], _APART * spacing_m)
            if k is None:
                continue
            position_m = curb.position_m[k]
            pose = upright_pose(position_m, _foot_m(yard, curb, position_m), float(curb.yaw_rad[k]))
            yard.tiles.place(with_lamp_index(mesh, (Material.STREET_LAMP,), first + len(occupied)), pose, curb.level)
            if curb.level == 0 and not is_fast:
                yard.lamp_posts.append((position_m, Base.SIDEWALK if curb.walk else Base.LAND))
            occupied = np.concatenate([occupied, [[*position_m, curb.level]]])
            x_m, y_m, z_m = apply(pose, np.array([lamp_at_m]))[0]
            yield StreetLight((float(x_m), float(y_m), float(z_m)))


def _first_free(yard: Yard, curb: CurbLine, choice: Int64Array, occupied_m: Float64Array, apart_m: float) -> int | None:
    """First of several positions of a curb that is free and far enough from all earlier lights."""
    for k in choice.tolist():
        position_m = curb.position_m[k]
        if np.any(np.hypot(*(occupied_m - position_m).T) < apart_m):
            continue
        if yard.map_objects.replace((ObjectKind.STREET_LAMP,), position_m[None])[0]:
            return None
        if curb.level or yard.claims.claim(shapely.Point(position_m).buffer(_ROOM_M, quad_segs=2)):
            return int(k)
    return None


def _foot_m(yard: Yard, curb: CurbLine, position_m: Float64Array) -> float:
    """Height of the surface that a light stands on."""
    ground, xy_m = yard.ground, position_m[None]
    if curb.level:
        return float(ground.road_m(xy_m, curb.level)[0])
    return float((ground.sidewalk_m(xy_m) if curb.walk else ground.land_m(xy_m))[0])
