"""Puts things that are not road users into a sample: posts, bushes, boxes and walls, as rays that meet them see them.

Streets hold more of them than any simulation, and where nothing but people is narrow and upright, a network takes every
post for one. A ray of the lidar that meets a thing ends there, so that things have as many points as any lidar would
see. Things stand off the road, where no object is, and hide none if they are wide.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from simbev_ros.baselines.grid import CELL_M, CELLS, HALF_M, level_from_map
from simbev_ros.foundation.semantics import BEV_CLASSES
from simbev_ros.foundation.types import AnyArray, BoolArray, Float64Array
from simbev_training.cache.layout import CM_PER_M
from simbev_training.cache.reader import Sample

_ROAD = 1 << BEV_CLASSES.index("road")
_RANGE_M = (3.0, 45.0)
_ROOM_M = 0.6
"""Distance between a thing and an object."""
_WIDE_RAD = 0.04
"""Half of the angle from which a thing is wide."""
_GROUND_M, _MIN_GROUND = 1.5, 3
"""Points of the ground are as near as this, and at least so many."""


class _Kind(NamedTuple):
    """Ranges of a kind of thing.

    Attributes:
        share: How frequent it is.
        length_m, width_m, height_m: Its sizes.
        open: Shares of rays that pass through it.
        rough_m: Standard deviation of where rays end.
    """

    share: float
    length_m: tuple[float, float]
    width_m: tuple[float, float]
    height_m: tuple[float, float]
    open: tuple[float, float]
    rough_m: float


_POST = _Kind(0.4, (0.06, 0.4), (0.06, 0.4), (0.5, 4.0), (0.0, 0.0), 0.01)
_BOX = _Kind(0.25, (0.3, 1.6), (0.25, 0.9), (0.3, 1.7), (0.0, 0.0), 0.01)
_BUSH = _Kind(0.25, (0.4, 2.0), (0.4, 1.6), (0.3, 2.2), (0.2, 0.7), 0.15)
_WALL = _Kind(0.1, (2.0, 8.0), (0.05, 0.6), (0.4, 1.8), (0.0, 0.7), 0.03)
_KINDS = (_POST, _BOX, _BUSH, _WALL)


class Thing(NamedTuple):
    """An upright block.

    Attributes:
        place_m: (3,) center of its base in the level frame.
        yaw_rad: Direction of its length there.
        size_m: (3,) length, width, height.
        open: Share of rays that pass through it.
        rough_m: Standard deviation of where rays end.
    """

    place_m: Float64Array
    yaw_rad: float
    size_m: Float64Array
    open: float
    rough_m: float


def add_clutter(sample: Sample, sweeps_cm: Sequence[AnyArray], mean: float, rng: np.random.Generator) -> list[AnyArray]:
    """Sweeps with things in them.

    Args:
        sample: A key frame.
        sweeps_cm: (N, 3) int16 points of each of its sweeps, ego frame, cm; may be fewer than the sample's.
        mean: Mean number of places that are tried.
        rng: Source of the draws.
    """
    newest = sample.sweep_poses[0]
    assert newest is not None
    level = level_from_map(newest)
    in_level = sweeps_cm[0].astype(np.float32) / np.float32(CM_PER_M) @ (level @ newest)[:3, :3].T.astype(np.float32)
    drawn = (_draw(sample, in_level, rng) for _ in range(rng.poisson(mean)))
    things = [each for each in drawn if each is not None]
    changed = []
    for points_cm, pose in zip(sweeps_cm, sample.sweep_poses, strict=True):
        if len(points_cm) and pose is not None and things:
            points_cm = _cast(points_cm, things, np.asarray(np.linalg.inv(level @ pose)), sample.lidar_m, rng)
        changed.append(points_cm)
    return changed


def _draw(sample: Sample, points: AnyArray, rng: np.random.Generator) -> Thing | None:
    """A thing; None if its place is not free, or no point shows the ground there."""
    kind = _KINDS[rng.choice(len(_KINDS), p=[each.share for each in _KINDS])]
    distance_m, azimuth_rad = rng.uniform(*_RANGE_M), rng.uniform(-np.pi, np.pi)
    place = distance_m * np.array([np.cos(azimuth_rad), np.sin(azimuth_rad)])
    size = np.array([rng.uniform(*each) for each in (kind.length_m, kind.width_m, kind.height_m)])
    yaw_rad, is_open = rng.uniform(-np.pi, np.pi), rng.uniform(*kind.open)
    row, column = np.clip(np.floor((HALF_M - place) / CELL_M).astype(int), 0, CELLS - 1)
    reach_m = float(np.hypot(*size[:2])) / 2
    if sample.cells[row, column] & _ROAD or not _is_free(sample, place, reach_m):
        return None
    near = (np.abs(points[:, 0] - place[0]) < _GROUND_M) & (np.abs(points[:, 1] - place[1]) < _GROUND_M)
    heights_m = points[near, 2]
    if len(heights_m) < _MIN_GROUND:
        return None
    return Thing(np.array([*place, np.percentile(heights_m, 10)]), yaw_rad, size, is_open, kind.rough_m)


def _is_free(sample: Sample, place: Float64Array, reach_m: float) -> bool:
    """Whether no object is at a place, nor behind it if what stands there is wide."""
    boxes = sample.boxes[sample.boxes["points"] > 0]
    away_m = np.hypot(boxes["x"] - place[0], boxes["y"] - place[1])
    radius_m = np.hypot(boxes["length"], boxes["width"]) / 2
    if (away_m < radius_m + reach_m + _ROOM_M).any():
        return False
    range_m, ranges_m = float(np.hypot(*place)), np.hypot(boxes["x"], boxes["y"])
    half_rad = reach_m / range_m
    apart_rad = np.abs(np.angle(np.exp(1j * (np.arctan2(boxes["y"], boxes["x"]) - np.arctan2(place[1], place[0])))))
    hides = (apart_rad < half_rad + radius_m / np.maximum(ranges_m, 1.0)) & (ranges_m > range_m)
    return half_rad < _WIDE_RAD or not bool(hides.any())


def _cast(
    points_cm: AnyArray,
    things: Sequence[Thing],
    ego_from_level: Float64Array,
    lidar_m: Float64Array,
    rng: np.random.Generator,
) -> AnyArray:
    """(N, 3) points of a sweep, of which those behind or in a thing are where their rays meet it."""
    rays = points_cm.astype(np.float32) / np.float32(CM_PER_M) - lidar_m.astype(np.float32)
    x, y = np.ascontiguousarray(rays[:, 0]), np.ascontiguousarray(rays[:, 1])
    range_m, share = np.hypot(x, y), np.ones(len(rays), np.float32)
    heading_rad = np.arctan2(ego_from_level[1, 0], ego_from_level[0, 0])
    for thing in things:
        base = ego_from_level[:3, :3] @ thing.place_m + ego_from_level[:3, 3] - lidar_m
        away_m, reach_m = float(np.hypot(base[0], base[1])), float(np.hypot(*thing.size_m[:2])) / 2
        if away_m <= reach_m:
            continue
        ahead, left = (np.float32(each) for each in base[:2] / away_m)
        beside_m, limit_m = np.abs(x * left - y * ahead), np.float32(reach_m / away_m) * range_m
        near = np.flatnonzero(beside_m < limit_m)
        near = near[x[near] * ahead + y[near] * left > away_m - reach_m]
        near = near[rng.random(len(near)) >= thing.open]
        met, hits = _shares(rays[near], base, thing, thing.yaw_rad + heading_rad)
        rough = rng.normal(0.0, thing.rough_m, int(hits.sum())) / np.maximum(range_m[near[hits]], 1.0)
        share[near[hits]] = np.minimum(share[near[hits]], met[hits] + rough)
    ends = np.flatnonzero(share < 1.0)
    result = points_cm.copy()
    result[ends] = np.rint((rays[ends] * share[ends, None] + lidar_m) * CM_PER_M).astype(np.int16)
    return result


def _shares(rays: AnyArray, base: Float64Array, thing: Thing, yaw_rad: float) -> tuple[AnyArray, BoolArray]:
    """(N,) share of each ray at which it meets a block, and whether it does: slabs, as for any box along the axes."""
    cosine, sine = np.cos(yaw_rad), np.sin(yaw_rad)
    turn = np.array([[cosine, sine], [-sine, cosine]])
    start, along = -turn @ base[:2], rays[:, :2] @ turn.T
    starts, steps = np.array([*start, -base[2]]), np.column_stack([along, rays[:, 2]])
    low = np.array([-thing.size_m[0] / 2, -thing.size_m[1] / 2, 0.0])
    high = np.array([thing.size_m[0] / 2, thing.size_m[1] / 2, thing.size_m[2]])
    steps = np.where(np.abs(steps) < 1e-9, 1e-9, steps)
    edges = np.stack([(low - starts) / steps, (high - starts) / steps])
    enter, leave = edges.min(0).max(1), edges.max(0).min(1)
    return enter, (enter < leave) & (enter > 0.0) & (enter < 1.0)
