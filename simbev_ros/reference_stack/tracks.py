"""The state of each tracked object, and its update by the reading of a cluster."""

import numpy as np

from simbev_ros.reference_stack.arrays import Booleans, Floats, Integers, Table, box_axes
from simbev_ros.reference_stack.classes import Kinds
from simbev_ros.reference_stack.kalman import correct
from simbev_ros.reference_stack.readings import Readings

_MIN_MOVED_M, _MIN_WALKING_MPS, _MIN_DRIVING_MPS = 1.0, 0.5, 1.5
"""Minimum distance moved, and minimum speeds, above which an object heads in its direction of motion."""
_HEADINGS_AGREE = np.cos(np.radians(15.0))
_MIN_READING_WEIGHT = 0.1
"""Minimum weight of a new reading, reached by objects with many readings."""
_MAX_COST = 100.0
_SIZE_MEMORY = 0.97
_SIZE_SIGMAS = 2.5
_MIN_BROADSIDE = 0.5
_MANY_POINTS = 30.0
_NOISE_M, _NOISE_PER_M, _NOISE_OF_COMPLETION = 0.1, 0.005, 0.2


def track_dtype(kinds: Kinds) -> np.dtype[np.void]:
    """Dtype of the tracks: one row per object, map frame."""
    return np.dtype(
        [
            ("id", "u4"),
            ("state", "f8", 4),  # x y vx vy of the box center
            ("covariance", "f8", (4, 4)),
            ("first_m", "f8", 2),  # first position
            ("moved_m", "f8"),  # maximum distance from there
            ("ground_m", "f8"),  # z of the ground below
            ("yaw", "f8"),
            ("size_m", "f8", 3),
            ("size_news", "f8", 3),  # decaying sum of the weights of the sizes seen
            ("size_off_m", "f8", 3),  # decaying sum of these weights times the deviation from the typical size
            ("cost", "f8", len(kinds.rarity)),  # running mean for each kind
            ("kind", "i4"),  # kind of lowest cost
            ("readings", "i4"),
            ("misses", "i4"),  # readings missed since the last one
            ("points", "i4"),
        ]
    )


def update(tracks: Table, readings: Readings, seen: Integers, kinds: Kinds) -> Table:
    """Update (T,) tracks with their (T,) clusters, given by number; return the updated copy."""
    tracks = tracks.copy()
    tracks["readings"] += 1
    tracks["misses"], tracks["points"] = 0, readings.points[seen]
    tracks["ground_m"] = readings.ground_m[seen]
    velocity = tracks["state"][:, 2:]
    speed, course = np.hypot(*velocity.T), np.arctan2(velocity[:, 1], velocity[:, 0])
    moves = (tracks["moved_m"] > _MIN_MOVED_M) & (speed > _MIN_WALKING_MPS)
    drives = moves & (speed > _MIN_DRIVING_MPS)
    along = np.abs(np.cos(readings.yaw_rad[seen] - course[:, None])).argmax(axis=1)
    cost = np.where(drives[:, None], readings.cost[seen, along], readings.cost[seen].min(axis=1))
    too_fast = np.where(moves[:, None], np.maximum(speed[:, None] - kinds.fastest_mps, 0.0), 0.0)
    reading_weight = np.maximum(1.0 / tracks["readings"], _MIN_READING_WEIGHT)[:, None]
    tracks["cost"] += reading_weight * (np.minimum(cost + too_fast**2, _MAX_COST) - tracks["cost"])
    tracks["kind"] = tracks["cost"].argmin(axis=1)
    reading = np.where(drives, along, readings.cost[seen, :, tracks["kind"]].argmin(axis=1))
    _update_heading(tracks, readings.yaw_rad[seen, reading], course, moves, drives, kinds)
    _update_size(tracks, readings, seen, reading, kinds)
    _update_position(tracks, readings, seen, reading, kinds)
    return tracks


def _update_heading(
    tracks: Table, seen_rad: Floats, course: Floats, moves: Booleans, drives: Booleans, kinds: Kinds
) -> None:
    """Set the heading to the seen one, oriented by motion or the previous heading; by motion alone if they disagree."""
    is_person = kinds.is_person[tracks["kind"]]
    follows = np.where(is_person, moves, drives)
    heading = np.where(follows, course, tracks["yaw"])
    seen_rad = np.where(np.cos(seen_rad - heading) < 0, seen_rad + np.pi, seen_rad)
    agree = np.cos(seen_rad - heading) > _HEADINGS_AGREE
    tracks["yaw"] = np.where(is_person | (follows & ~agree), heading, seen_rad)


def _update_size(tracks: Table, readings: Readings, seen: Integers, reading: Integers, kinds: Kinds) -> None:
    """Adopt those parts of the seen size that are in view and plausible; the rest is typical for the kind."""
    kind, view = tracks["kind"], readings.view[seen, reading]
    excess_m = readings.seen_m[seen, reading] - kinds.seen_m[kind]
    weight = np.empty_like(excess_m)
    weight[:, :2] = np.where(view > _MIN_BROADSIDE, view**2, 0.0)
    weight[:, 1] *= excess_m[:, 1] > 0  # mirrors are part of the width but rarely hit
    weight[:, 2] = np.clip(1.0 - 2.0 * readings.ring_gap_m[seen], 0.0, 1.0)
    weight *= np.abs(excess_m) < _SIZE_SIGMAS * kinds.sigma_m[kind]
    weight *= np.clip(readings.points[seen] / _MANY_POINTS, 0.0, 1.0)[:, None]
    tracks["size_news"] = _SIZE_MEMORY * tracks["size_news"] + weight
    tracks["size_off_m"] = _SIZE_MEMORY * tracks["size_off_m"] + weight * excess_m
    tracks["size_m"] = kinds.size_m[kind] + tracks["size_off_m"] / (1.0 + tracks["size_news"])


def _update_position(tracks: Table, readings: Readings, seen: Integers, reading: Integers, kinds: Kinds) -> None:
    """Extend the visible part to the object's size, away from the sensor, and correct the filter with its center."""
    axes = box_axes(readings.yaw_rad[seen, reading])
    hidden_m = np.maximum(tracks["size_m"][:, :2] - readings.seen_m[seen, reading, :2], 0.0)
    shift_m = -readings.sensor_side[seen, reading] * hidden_m / 2
    shift_m[kinds.is_person[tracks["kind"]]] /= 2
    center_m = readings.center_m[seen] + np.einsum("ts,tsi->ti", shift_m, axes)
    noise_m = _NOISE_M + _NOISE_PER_M * readings.range_m[seen, None] + _NOISE_OF_COMPLETION * np.abs(shift_m)
    noise_m2 = np.einsum("tsi,ts,tsj->tij", axes, noise_m**2, axes)
    is_new = tracks["readings"] == 1
    tracks["state"][is_new, :2] = tracks["first_m"][is_new] = center_m[is_new]
    tracks["state"], tracks["covariance"] = correct(tracks["state"], tracks["covariance"], center_m, noise_m2)
    moved_m = np.linalg.norm(tracks["state"][:, :2] - tracks["first_m"], axis=1)
    tracks["moved_m"] = np.maximum(tracks["moved_m"], moved_m)


def distances_m(tracks: Table, positions_m: Floats) -> tuple[Floats, Floats]:
    """(T, C) distances of (C, 2) positions from the edges of the tracks' boxes, 0 inside, and from their centers."""
    offset_m = positions_m - tracks["state"][:, None, :2]
    local_m = np.einsum("tsi,tci->tcs", box_axes(tracks["yaw"]), offset_m)
    outside_m = np.maximum(np.abs(local_m) - tracks["size_m"][:, None, :2] / 2, 0.0)
    return np.linalg.norm(outside_m, axis=2), np.linalg.norm(offset_m, axis=2)
