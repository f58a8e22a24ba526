"""Finds where people can rest in a region: on benches and chairs, in bus shelters, before shop windows.

The things that have been placed enter, a table of spots leaves. Which of them are taken differs from scene to scene,
and is drawn by ``simulation.world.resting``.
"""

import numpy as np
import shapely

from simbev_ros.assets.land.yard import Yard
from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.mesh.primitives import Finish, box
from simbev_ros.assets.street.furniture import bench, bus_shelter
from simbev_ros.assets.street.rest_kinds import REST_DTYPE, RestKind, rests_at_things, seats_among
from simbev_ros.assets.street.surface import surface_m
from simbev_ros.foundation.geometry.transforms import matrices_from_xyz_rpy
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Float64Array, Table

_THINGS = {"bench": bench, "bus_shelter": bus_shelter}
_LEGROOM_M, _FEET_M, _LEVEL_M = 0.85, 0.6, 0.035  # from the back of a seat
_FROM_CROSSING_M = 6.0  # seats on sidewalks: nearer to a crosswalk people come from all sides
_PASSAGE_M = 1.7  # from the back of a seat on a sidewalk to what others must be able to walk on


def rest_spots(yard: Yard) -> Table:
    """(K,) ``REST_DTYPE`` of a region in which everything has been placed, without those on slopes and in passages."""
    at_things = {id(build()): rests_at_things()[name] for name, build in _THINGS.items()}
    found = [*yard.rests, *((at_things.get(id(mesh)), poses) for mesh, poses in yard.tiles.placed_objects)]
    rows = [_rows(poses, at) for at, poses in found if at is not None]
    rests: Table = np.concatenate([np.zeros(0, REST_DTYPE), *rows])
    xy_m = np.column_stack([rests["x"], rests["y"]])
    on_ground = rests["kind"] == RestKind.WINDOW
    rests["z"][on_ground] = surface_m(yard.ground, xy_m[on_ground], 0)
    ahead = np.column_stack([np.cos(rests["yaw"]), np.sin(rests["yaw"])])
    seat = seats_among(rests)
    feet_m = xy_m + _FEET_M * seat[:, None] * ahead
    level = np.abs(surface_m(yard.ground, feet_m, 0) - rests["z"]) < _LEVEL_M
    streets = yard.ground.streets[0]
    blocks = shapely.contains_xy(streets.area, xy_m) & seat
    passable = shapely.contains_xy(streets.sidewalk, xy_m + _PASSAGE_M * ahead)
    passable &= ~shapely.dwithin(streets.crosswalk, shapely.points(xy_m), _FROM_CROSSING_M)
    return rests[level & (passable | ~blocks)]


def legroom(rests: Table) -> tuple[Mesh, Float64Array]:
    """A box that stands for the legs of those who sit, and its (K, 4, 4) poses at the seats among (N,) spots."""
    seats = rests[seats_among(rests)]
    room = box(Finish(Material.PLAIN, Tag.PEDESTRIAN, (0, 0, 0)), (_LEGROOM_M, 0.5, 0.4), (_LEGROOM_M / 2.0, 0.0, 0.25))
    rpy_rad = np.column_stack([np.zeros((len(seats), 2)), seats["yaw"]])
    return room, matrices_from_xyz_rpy(np.column_stack([seats["x"], seats["y"], seats["z"]]), rpy_rad)


def _rows(poses: Float64Array, at: Float64Array) -> Table:
    """(N * K,) ``REST_DTYPE`` of (K, 5) spots at things with (N, 4, 4) upright poses."""
    rests = np.zeros((len(poses), len(at)), REST_DTYPE)
    map_m = np.einsum("nij,kj->nki", poses[:, :3, :3], at[:, :3]) + poses[:, None, :3, 3]
    rests["x"], rests["y"], rests["z"] = (map_m[..., axis] for axis in range(3))
    rests["yaw"] = np.arctan2(poses[:, 1, 0], poses[:, 0, 0])[:, None] + np.radians(at[:, 3])
    rests["kind"] = at[:, 4]
    return rests.ravel()
