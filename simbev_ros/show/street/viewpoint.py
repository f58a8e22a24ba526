"""Finds a viewpoint for a picture from the street: a position and a direction with much to see and nothing in the way.

A map and the tiles of its static scene enter; a position on a driving lane and a direction leave. Objects are grid
cells in plan with the height of their top. A view is a row of angular sectors; in each, buildings occlude what is
behind them. Each kind of object scores by the share of sectors in which it is visible, buildings also by their
elevation angle.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from simbev_ros.assets.placement.static_scene import Tile
from simbev_ros.foundation.geometry.ragged import ragged_indices
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import BoolArray, Float64Array
from simbev_ros.maps.network import RoadNetwork

_SPACING_M = 8.0
_MAX_POSITIONS = 500
_CELL_M = 2.0
_HALF_VIEW_RAD = np.radians(34.0)
_ASIDE_RAD = np.radians([0.0, 22.0, -22.0])  # angles from the lane's direction that are tried
_SECTORS = 34
_AHEAD_RAD = np.radians(7.0)
_CLOSE_M, _NEAR_M, _FAR_M = 8.0, 17.0, 130.0
_OTHER_ROAD_M, _OVERHEAD_M, _UNDER_M = (
    13.0,
    4.0,
    38.0,
)  # a structure at this lateral distance or height is not the one that carries the viewpoint
_WATER_M = 65.0  # beyond this distance water is hardly visible
_WORTH = {Tag.BUILDING: 1.1, Tag.VEGETATION: 0.8, Tag.BRIDGE: 1.9, Tag.WATER: 1.6, Tag.TRAFFIC_LIGHT: 0.8}
_RISE_WORTH, _TALL = 0.9, 0.45  # score of buildings whose elevation angle has at least this tangent in all sectors
_OPEN_WORTH, _OPEN_M = 1.2, 90.0
_ALONG_WORTH = 0.35
_OBSTRUCTION_PENALTY = 2.5


class _Cells(NamedTuple):
    """N occupied grid cells: (N, 2) centers in plan, (N,) heights of the top, (N,) semantic tags; map frame."""

    xy_m: Float64Array
    top_m: Float64Array
    tag: np.ndarray[tuple[int], np.dtype[np.uint8]]


def find_viewpoint(
    network: RoadNetwork, tiles: Sequence[Tile], center_m: Float64Array, within_m: float
) -> tuple[Float64Array, float]:
    """Find the viewpoint near a position that has an open view and the most to see.

    Args:
        network: The map.
        tiles: Tiles of the map's static scene.
        center_m: (2,) position around which viewpoints are searched, map frame.
        within_m: Maximum distance of the viewpoint from it.

    Returns:
        (3,) position on a driving lane, map frame, and the yaw of the viewing direction, radians.
    """
    waypoints = network.waypoints(_SPACING_M)
    near = np.flatnonzero(np.linalg.norm(waypoints.position_m[:, :2] - center_m, axis=1) < within_m)
    near = near[:: max(1, -(-len(near) // _MAX_POSITIONS))]
    cells = _cells([tile for tile in tiles if np.hypot(*(tile.origin_m[:2] - center_m)) < within_m + _FAR_M])
    tree = cKDTree(cells.xy_m)
    best, best_score = (waypoints.position_m[near[0]], float(waypoints.yaw_rad[near[0]])), -np.inf
    for k in near.tolist():
        position_m, yaw_rad = waypoints.position_m[k], float(waypoints.yaw_rad[k])
        around = np.sort(np.array(tree.query_ball_point(position_m[:2], _FAR_M), np.int64))
        seen = _Cells(cells.xy_m[around], cells.top_m[around], cells.tag[around])
        for aside_rad in _ASIDE_RAD.tolist():
            score = _score(position_m, yaw_rad, aside_rad, seen)
            if score > best_score:
                best, best_score = (position_m, yaw_rad + aside_rad), score
    return best


def _score(position_m: Float64Array, yaw_rad: float, aside_rad: float, cells: _Cells) -> float:
    """Score of a view; higher is better."""
    offset_m = cells.xy_m - position_m[:2]
    distance_m = np.hypot(*offset_m.T)
    angle = np.arctan2(offset_m[:, 1], offset_m[:, 0]) - yaw_rad
    from_road_m = np.abs(distance_m * np.sin(angle))
    angle = (angle - aside_rad + np.pi) % (2.0 * np.pi) - np.pi
    in_view = np.abs(angle) < _HALF_VIEW_RAD
    sector = np.clip(((angle / _HALF_VIEW_RAD + 1.0) / 2.0 * _SECTORS).astype(int), 0, _SECTORS - 1)
    walls = in_view & (cells.tag == Tag.BUILDING) & (cells.top_m > position_m[2] + 3.0)
    wall_m = np.full(_SECTORS, np.inf)
    np.minimum.at(wall_m, sector[walls], distance_m[walls])
    shown = in_view & (distance_m < wall_m[sector] + 2.0 * _CELL_M)
    is_other = (from_road_m > _OTHER_ROAD_M) | (cells.top_m > position_m[2] + _OVERHEAD_M)
    shown &= (cells.tag != Tag.BRIDGE) | is_other
    shown &= (cells.tag != Tag.WATER) | (distance_m < _WATER_M)
    far = shown & (distance_m > _NEAR_M)
    rise = np.zeros(_SECTORS)
    tall = far & walls
    np.maximum.at(rise, sector[tall], np.minimum((cells.top_m[tall] - position_m[2]) / distance_m[tall] / _TALL, 1.0))
    score = sum(worth * _share(sector[far & (cells.tag == tag)]) ** 0.5 for tag, worth in _WORTH.items())
    score += _RISE_WORTH * float(rise.mean()) ** 0.5
    ahead_m = np.min(distance_m[walls & (np.abs(angle) < _AHEAD_RAD)], initial=_FAR_M)
    score += _OPEN_WORTH * min(ahead_m / _OPEN_M, 1.0) + _ALONG_WORTH * (aside_rad == 0.0)
    under = shown & (cells.tag == Tag.BRIDGE) & (cells.top_m > position_m[2] + _OVERHEAD_M) & (distance_m < _UNDER_M)
    solid = np.isin(cells.tag, (Tag.BUILDING, Tag.VEGETATION, Tag.TRAFFIC_LIGHT)) & (cells.top_m > position_m[2] + 1.0)
    obstructed = _share(sector[(shown & solid & (distance_m < _NEAR_M)) | under])
    too_close = _share(sector[shown & solid & (distance_m < _CLOSE_M)])
    return float(score - _OBSTRUCTION_PENALTY * (obstructed**1.5 + too_close))


def _share(sectors: np.ndarray[tuple[int], np.dtype[np.int64]]) -> float:
    """Share of all sectors that occur in an array of sector indices."""
    return len(np.unique(sectors)) / _SECTORS


def _cells(tiles: Sequence[Tile]) -> _Cells:
    """All grid cells that edges of triangles with a scored tag pass through, each with its highest point."""
    keys, tops, tags = [np.empty((0, 2))], [np.empty(0)], [np.empty(0, np.uint8)]
    for tile in tiles:
        for tag in _WORTH:
            points_m = _along_edges(tile, tile.mesh.tag[tile.mesh.triangles[:, 0]] == tag)
            if len(points_m):
                key, cell = np.unique(np.floor(points_m[:, :2] / _CELL_M), axis=0, return_inverse=True)
                top_m = np.full(len(key), -np.inf)
                np.maximum.at(top_m, cell.reshape(-1), points_m[:, 2])
                keys.append(key)
                tops.append(top_m)
                tags.append(np.full(len(key), tag, np.uint8))
    return _Cells((np.concatenate(keys) + 0.5) * _CELL_M, np.concatenate(tops), np.concatenate(tags))


def _along_edges(tile: Tile, chosen: BoolArray) -> Float64Array:
    """(N, 3) points along the edges of the chosen triangles, at most one cell apart, map frame."""
    corners_m = tile.mesh.vertices[tile.mesh.triangles[chosen]].astype(np.float64)
    starts_m, ends_m = corners_m.reshape(-1, 3), np.roll(corners_m, -1, axis=1).reshape(-1, 3)
    count = np.ceil(np.hypot(*(ends_m - starts_m)[:, :2].T) / _CELL_M).astype(int) + 1
    edge, number = ragged_indices(count)
    share = number / count[edge]
    points_m: Float64Array = starts_m[edge]
    points_m += share[:, None] * (ends_m - starts_m)[edge]
    return points_m + tile.origin_m
