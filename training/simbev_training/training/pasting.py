"""Copies rare objects from another frame into a sample, with their points, cells and boxes, where there is room.

Ground-truth sampling as in SECOND (https://doi.org/10.3390/s18103337): without it, the few trucks and buses of a
dataset are learned by heart. An object keeps its place relative to the ego, so its points are as dense as they would
be. What it would hide from the lidar is removed.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import reduce
from operator import or_
from typing import NamedTuple

import numpy as np

from simbev_ros.baselines.boxes import DETECTED_CLASSES
from simbev_ros.baselines.grid import CELL_M, CELLS, HALF_M, level_from_map
from simbev_ros.foundation.semantics import BEV_CLASSES
from simbev_ros.foundation.types import AnyArray, Float64Array, Table
from simbev_training.cache.layout import CM_PER_M
from simbev_training.cache.reader import CachedScene, Sample


def _bits(*names: str) -> int:
    return reduce(or_, (1 << BEV_CLASSES.index(name) for name in names))


_PASTED = [DETECTED_CLASSES.index(name) for name in ("truck", "bus", "motorcycle", "bicycle")]
_PASTED_BITS = _bits("truck", "bus", "motorcycle", "bicycle", "rider")
_OBJECT_BITS = _PASTED_BITS | _bits("car", "pedestrian", "hazard", "traffic_cone", "barrier")
_GROUND_BITS = _bits("road", "sidewalk")
_MIN_POINTS = 5
_AROUND_M = 0.2
"""Points and cells of an object may be that far outside its box."""
_ROOM_M = 0.5
"""Distance of other objects."""
_ALIKE = 0.7
"""Minimum share of the cells below an object that are road or sidewalk in both frames, or neither."""
_MIN_RANGE_M = 4.0
_MAX_STEP_M = 1.0
"""Maximum difference in the height of the ground."""
_ABOVE_GROUND_M = 0.08
"""Lower points are the ground's."""


def frames_with_rare_objects(scenes: Sequence[CachedScene]) -> list[tuple[int, int]]:
    """Scene and key frame of all frames with objects to paste."""
    found = []
    for number, scene in enumerate(scenes):
        boxes, ends = scene.boxes, scene.frames["boxes_end"]
        counts = np.concatenate([[0], np.cumsum(_is_rare(boxes))])[np.concatenate([[0], ends])]
        found += [(number, int(frame)) for frame in np.flatnonzero(np.diff(counts))]
    return found


class Pasted(NamedTuple):
    """A sample with objects of another.

    Attributes:
        sample: The sample; its images are as before.
        boxes: (M,) the objects' boxes as they are in the other.
        steps_m: (M,) how much higher they stand now.
    """

    sample: Sample
    boxes: Table
    steps_m: Float64Array


def paste(sample: Sample, donor: Sample, sweep_ages_s: Sequence[float]) -> Pasted:
    """Paste those rare objects of a donor for which a sample has room.

    Args:
        sample: A key frame.
        donor: Another one.
        sweep_ages_s: Ages of the sweeps of both.
    """
    if any(ours is not None and theirs is None for ours, theirs in zip(sample.sweeps_cm, donor.sweeps_cm, strict=True)):
        return Pasted(sample, donor.boxes[:0], np.zeros(0))
    target, source = _Cloud(sample, sweep_ages_s), _Cloud(donor, sweep_ages_s)
    cells, boxes, steps_m = np.array(sample.cells), [donor.boxes[:0]], []
    for box in donor.boxes[_is_rare(donor.boxes)]:
        below = _covered(box, 0.0)
        alike = (cells[below] ^ donor.cells[below]) & _GROUND_BITS == 0
        if not len(alike) or alike.mean() < _ALIKE or (cells[_covered(box, _ROOM_M)] & _OBJECT_BITS).any():
            continue
        ground_m = target.ground_m(box)
        step_m = ground_m - (box["z"] - box["height"] / 2)
        if not abs(step_m) < _MAX_STEP_M:
            continue
        parts = source.points_of(box)
        target.clear(box)
        target.add(parts, step_m)
        covered = _covered(box, _AROUND_M)
        cells[covered] |= donor.cells[covered] & _PASTED_BITS
        boxes.append(np.array([box]))
        steps_m.append(step_m)
    pasted, steps = np.concatenate(boxes), np.array(steps_m, np.float64)
    moved = pasted.copy()
    moved["z"] += steps
    changed = replace(sample, sweeps_cm=target.sweeps_cm(), cells=cells, boxes=np.concatenate([sample.boxes, moved]))
    return Pasted(changed, pasted, steps)


class _Cloud:
    """The sweeps of a sample, and what is changed in them."""

    def __init__(self, sample: Sample, ages_s: Sequence[float]) -> None:
        newest = sample.sweep_poses[0]
        assert newest is not None
        level_from_newest = level_from_map(newest)
        self._sweeps = list(sample.sweeps_cm)
        self._poses = [None if pose is None else level_from_newest @ pose for pose in sample.sweep_poses]
        self._ages_s = ages_s
        self._lidar_m = float(sample.lidar_m[2])

    def sweeps_cm(self) -> tuple[AnyArray | None, ...]:
        """(N, 3) int16 points of each sweep as they are now."""
        return tuple(self._sweeps)

    def ground_m(self, box: Table) -> float:
        """Height of the ground where a box is to stand, NaN if no point shows it."""
        near = np.concatenate([self._near(sweep, box) for sweep in range(len(self._sweeps))])
        heights = near[_inside(near, box, _ROOM_M)][:, 2]
        return float(np.percentile(heights, 10)) if len(heights) else np.nan

    def points_of(self, box: Table) -> list[Float64Array]:
        """(N, 3) points in m, level frame, of an object in each sweep; motion is straight."""
        bottom_m = box["z"] - box["height"] / 2
        parts = []
        for sweep in range(len(self._sweeps)):
            at = self._moved(box, sweep)
            points = self._near(sweep, at)
            height_m = points[:, 2] - bottom_m
            over = (height_m > _ABOVE_GROUND_M) & (height_m < box["height"] + _AROUND_M)
            parts.append(points[over & _inside(points, at, _AROUND_M)])
        return parts

    def clear(self, box: Table) -> None:
        """Remove the points where an object is to stand, and those that it would hide."""
        for sweep, pose in enumerate(self._poses):
            points = self._sweeps[sweep]
            if points is None or pose is None:
                continue
            at = self._moved(box, sweep)
            ego_from_level = np.linalg.inv(pose)
            cosine, sine = np.cos(at["yaw"]), np.sin(at["yaw"])
            ahead = np.array([cosine, sine]) * at["length"] / 2
            left = np.array([-sine, cosine]) * at["width"] / 2
            middle = np.array([at["x"], at["y"]])
            corners = [middle + a * ahead + b * left for a in (-1, 1) for b in (-1, 1)]
            corners_cm = [(ego_from_level[:2, :2] @ each + ego_from_level[:2, 3]) * CM_PER_M for each in corners]
            center_cm = np.mean(corners_cm, 0)
            range_cm = float(np.linalg.norm(center_cm))
            toward = center_cm / range_cm
            slopes = [(toward[0] * y - toward[1] * x) / max(toward @ (x, y), 1.0) for x, y in corners_cm]
            top_cm = (at["z"] + at["height"] / 2 + ego_from_level[2, 3] - self._lidar_m) * CM_PER_M
            x, y, z = points.astype(np.float32).T
            along, across = toward[0] * x + toward[1] * y, toward[0] * y - toward[1] * x
            hidden = (along > range_cm) & (across > min(slopes) * along) & (across < max(slopes) * along)
            hidden &= (z - self._lidar_m * CM_PER_M) * range_cm < top_cm * along
            reach_cm = CM_PER_M * np.hypot(at["length"], at["width"]) / 2
            near = np.flatnonzero((np.abs(x - center_cm[0]) < reach_cm) & (np.abs(y - center_cm[1]) < reach_cm))
            level = points[near] / CM_PER_M @ pose[:3, :3].T + pose[:3, 3]
            hidden[near] |= _inside(level, at, 0.0)
            self._sweeps[sweep] = points.compress(~hidden, 0)

    def add(self, parts: Sequence[Float64Array], step_m: float) -> None:
        """Add points in m, level frame, to each sweep, higher by a step."""
        for sweep, points in enumerate(parts):
            ours, pose = self._sweeps[sweep], self._poses[sweep]
            if ours is not None and pose is not None:
                ego_from_level = np.linalg.inv(pose)
                step = np.array([0.0, 0.0, step_m])
                placed = (points + step) @ ego_from_level[:3, :3].T + ego_from_level[:3, 3]
                self._sweeps[sweep] = np.concatenate([ours, np.rint(placed * CM_PER_M).astype(np.int16)])

    def _near(self, sweep: int, box: Table) -> Float64Array:
        """(N, 3) points of a sweep in m, level frame, around a box."""
        points, pose = self._sweeps[sweep], self._poses[sweep]
        if points is None or pose is None:
            return np.zeros((0, 3))
        center_cm = (np.linalg.inv(pose) @ [box["x"], box["y"], box["z"], 1.0]) * CM_PER_M
        reach_cm = CM_PER_M * (np.hypot(box["length"], box["width"]) / 2 + _ROOM_M)
        near = np.abs(points[:, 0] - center_cm[0]) < reach_cm
        near &= np.abs(points[:, 1] - center_cm[1]) < reach_cm
        return np.asarray(points[near] / CM_PER_M @ pose[:3, :3].T + pose[:3, 3])

    def _moved(self, box: Table, sweep: int) -> Table:
        """A box where it was at the time of a sweep."""
        moved = box.copy()
        moved["x"] -= box["vx"] * self._ages_s[sweep]
        moved["y"] -= box["vy"] * self._ages_s[sweep]
        return moved


def _is_rare(boxes: Table) -> AnyArray:
    """(B,) whether boxes are objects to paste."""
    away_m = np.maximum(np.abs(boxes["x"]), np.abs(boxes["y"]))
    return (
        np.isin(boxes["class"], _PASTED)
        & (boxes["points"] >= _MIN_POINTS)
        & (np.hypot(boxes["x"], boxes["y"]) > _MIN_RANGE_M + boxes["length"] / 2)
        & (away_m < HALF_M)
    )


def _inside(points: Float64Array, box: Table, margin_m: float) -> AnyArray:
    """(N,) whether (N, 3) points are within a box's sides, at any height."""
    x, y = points[:, 0] - box["x"], points[:, 1] - box["y"]
    cosine, sine = np.cos(box["yaw"]), np.sin(box["yaw"])
    along, across = np.abs(cosine * x + sine * y), np.abs(cosine * y - sine * x)
    return np.asarray((along < box["length"] / 2 + margin_m) & (across < box["width"] / 2 + margin_m))


def _covered(box: Table, margin_m: float) -> tuple[AnyArray, AnyArray]:
    """Rows and columns of the cells with centers within a box's sides."""
    reach = np.hypot(box["length"], box["width"]) / 2 + margin_m
    middle = (HALF_M - np.array([box["x"], box["y"]])) / CELL_M
    low = np.clip(np.floor(middle - reach / CELL_M), 0, CELLS).astype(int)
    high = np.clip(np.ceil(middle + reach / CELL_M), 0, CELLS).astype(int)
    row, column = (each.ravel() for each in np.mgrid[low[0] : high[0], low[1] : high[1]])
    centers = HALF_M - (np.stack([row, column], 1) + 0.5) * CELL_M
    inside = _inside(centers, box, margin_m)
    return row[inside], column[inside]
