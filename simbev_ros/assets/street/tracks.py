"""Builds the rails of railways and trams along a line: on ballast and sleepers, or flush with a street."""

import numpy as np
import shapely

from simbev_ros.assets.land.yard import Yard
from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.mesh.primitives import Finish, boxes, loft
from simbev_ros.assets.placement.tiles import upright_pose
from simbev_ros.assets.street.surface import surface_m
from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.geometry.plan_view import left_of
from simbev_ros.foundation.geometry.transforms import matrices_from_xyz_rpy
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import BoolArray, Float64Array

_GAUGE_M, _RAIL_M = 1.435, 0.07
_TOP_M, _FLUSH_M, _ROOT_M = 0.16, 0.012, -0.2
_BED_M, _BED_RISE_M, _CLEAR_M = 3.0, 0.03, 2.0
_SLEEPER_M, _SLEEPER_SPACING_M = (0.24, 2.5, 0.3), 0.65
_STRETCH_M, _STEP_M = 32.0, 2.0

_STEEL = Finish(Material.METAL, Tag.RAIL_TRACK, (112, 104, 98))
_SLEEPER = Finish(Material.CONCRETE, Tag.RAIL_TRACK, (132, 128, 120))
_BALLAST = Finish(Material.SOIL, Tag.RAIL_TRACK, (118, 110, 102))


def lay_track(yard: Yard, line: shapely.LineString) -> None:
    """Lay a track along a line within the region: rails, and off the streets also ballast and sleepers."""
    bed = overlay.intersection(shapely.buffer(line, _BED_M / 2.0, cap_style="flat"), yard.ground.land)
    yard.cover(bed, _BALLAST, rise_m=_BED_RISE_M)
    yard.claims.add(shapely.buffer(line, _CLEAR_M, cap_style="flat"))
    for start_m in np.arange(0.0, line.length, _STRETCH_M):
        end_m = min(start_m + _STRETCH_M, line.length)
        stations_m = np.linspace(start_m, end_m, max(2, int((end_m - start_m) / _STEP_M) + 2))
        middle_m = shapely.get_coordinates(line.interpolate((start_m + end_m) / 2.0))[0]
        mesh = Mesh.merge(
            [_rails(yard, line, stations_m, middle_m), *_sleepers(yard, line, (start_m, end_m), middle_m)]
        )
        yard.tiles.place(mesh, upright_pose(middle_m, 0.0))


def _rails(yard: Yard, line: shapely.LineString, stations_m: Float64Array, middle_m: Float64Array) -> Mesh:
    """Both rails along stations of a line, relative to a (2,) point of the map."""
    xy_m, left = _points(line, stations_m)
    rails = []
    for side in (-0.5, 0.5):
        center_m = xy_m + side * _GAUGE_M * left
        top_m = np.where(_on_street(yard, center_m), _FLUSH_M, _TOP_M)
        ground_m = surface_m(yard.ground, center_m, 0)
        sections = np.empty((len(xy_m), 4, 3))
        for corner, (out, high) in enumerate(((-1.0, False), (-1.0, True), (1.0, True), (1.0, False))):
            sections[:, corner, :2] = center_m - middle_m + out * _RAIL_M / 2.0 * left
            sections[:, corner, 2] = ground_m + (top_m if high else _ROOT_M)
        rails.append(loft(_STEEL, sections, crease_deg=0.0))
    return Mesh.merge(rails)


def _sleepers(yard: Yard, line: shapely.LineString, span_m: tuple[float, float], middle_m: Float64Array) -> list[Mesh]:
    """The sleepers between two stations, where there is no street."""
    xy_m, left = _points(line, np.arange(*span_m, _SLEEPER_SPACING_M))
    free = ~_on_street(yard, xy_m)
    xy_m, left = xy_m[free], left[free]
    if len(xy_m) == 0:
        return []
    center_m = np.column_stack([xy_m - middle_m, surface_m(yard.ground, xy_m, 0) - _SLEEPER_M[2] / 2.0 + _TOP_M / 2.0])
    yaw_rad = np.arctan2(-left[:, 0], left[:, 1])
    poses = matrices_from_xyz_rpy(center_m, np.column_stack([np.zeros((len(xy_m), 2)), yaw_rad]))
    return boxes(_SLEEPER, np.array([_SLEEPER_M]), np.zeros((1, 3))).copies(poses)


def _points(line: shapely.LineString, stations_m: Float64Array) -> tuple[Float64Array, Float64Array]:
    """(N, 2) points at distances along a line, and the (N, 2) unit vectors to its left."""
    xy_m, behind_m, ahead_m = (
        shapely.get_coordinates(shapely.line_interpolate_point(line, np.clip(stations_m + step_m, 0.0, line.length)))
        for step_m in (0.0, -0.5, 0.5)
    )
    along = ahead_m - behind_m
    return xy_m, left_of(along / np.maximum(np.hypot(*along.T), 1e-9)[:, None])


def _on_street(yard: Yard, xy_m: Float64Array) -> BoolArray:
    """(N,) whether points lie on streets on the ground."""
    return np.asarray(shapely.contains_xy(yard.ground.streets[0].area, xy_m))
