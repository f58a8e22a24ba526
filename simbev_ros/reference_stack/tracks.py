"""What the stack believes of each object, and what a reading of a cluster changes in it."""

import numpy as np

from simbev_ros.reference_stack.arrays import Booleans, Floats, Integers, Table, box_axes
from simbev_ros.reference_stack.classes import Kinds
from simbev_ros.reference_stack.kalman import correct
from simbev_ros.reference_stack.readings import Readings

_MOVED_M, _WALKS_MPS, _DRIVES_MPS = 1.0, 0.5, 1.5
"""What has gone so far, and is so fast, heads where it goes."""
_HEADINGS_AGREE = np.cos(np.radians(15.0))
_LEAST_NEWS = 0.1
"""Weight of a new reading of an old object."""
_MOST_COST = 100.0
_SIZE_MEMORY = 0.97
_SIZE_SIGMAS = 2.5
_BROADSIDE = 0.5
_SURE_POINTS = 30.0
_NOISE_M, _NOISE_PER_M, _NOISE_OF_COMPLETION = 0.1, 0.005, 0.2


def track_dtype(kinds: Kinds) -> np.dtype[np.void]:
    """One row per object, map frame."""
    return np.dtype(
        [
            ("id", "u4"),
            ("state", "f8", 4),  # x y vx vy of the box's centre
            ("covariance", "f8", (4, 4)),
            ("first_m", "f8", 2),  # where it was first
            ("moved_m", "f8"),  # how far it has been from there
            ("ground_m", "f8"),  # z below it
            ("yaw", "f8"),
            ("size_m", "f8", 3),
            ("size_news", "f8", 3),  # sum of weights of the sizes seen, fading
            ("size_off_m", "f8", 3),  # sum of them times what is more than usual
            ("cost", "f8", len(kinds.rarity)),  # mean of each kind
            ("kind", "i4"),  # the cheapest
            ("readings", "i4"),
            ("misses", "i4"),  # since the last one
            ("points", "i4"),
        ]
    )


def update(tracks: Table, readings: Readings, seen: Integers, kinds: Kinds) -> Table:
    """(T,) tracks after the (T,) clusters of these numbers were found to be theirs."""
    tracks = tracks.copy()
    tracks["readings"] += 1
    tracks["misses"], tracks["points"] = 0, readings.points[seen]
    tracks["ground_m"] = readings.ground_m[seen]
    velocity = tracks["state"][:, 2:]
    speed, course = np.hypot(*velocity.T), np.arctan2(velocity[:, 1], velocity[:, 0])
    moves = (tracks["moved_m"] > _MOVED_M) & (speed > _WALKS_MPS)
    drives = moves & (speed > _DRIVES_MPS)
    along = np.abs(np.cos(readings.yaw_rad[seen] - course[:, None])).argmax(axis=1)
    cost = np.where(drives[:, None], readings.cost[seen, along], readings.cost[seen].min(axis=1))
    too_fast = np.where(moves[:, None], np.maximum(speed[:, None] - kinds.fastest_mps, 0.0), 0.0)
    news = np.maximum(1.0 / tracks["readings"], _LEAST_NEWS)[:, None]
    tracks["cost"] += news * (np.minimum(cost + too_fast**2, _MOST_COST) - tracks["cost"])
    tracks["kind"] = tracks["cost"].argmin(axis=1)
    reading = np.where(drives, along, readings.cost[seen, :, tracks["kind"]].argmin(axis=1))
    _turn(tracks, readings.yaw_rad[seen, reading], course, moves, drives, kinds)
    _resize(tracks, readings, seen, reading, kinds)
    _place(tracks, readings, seen, reading, kinds)
    return tracks


def _turn(tracks: Table, seen_rad: Floats, course: Floats, moves: Booleans, drives: Booleans, kinds: Kinds) -> None:
    """Head as is seen, with the front where it goes or as before; or as it goes, if that does not agree."""
    is_person = kinds.is_person[tracks["kind"]]
    follows = np.where(is_person, moves, drives)
    heading = np.where(follows, course, tracks["yaw"])
    seen_rad = np.where(np.cos(seen_rad - heading) < 0, seen_rad + np.pi, seen_rad)
    agree = np.cos(seen_rad - heading) > _HEADINGS_AGREE
    tracks["yaw"] = np.where(is_person | (follows & ~agree), heading, seen_rad)


def _resize(tracks: Table, readings: Readings, seen: Integers, reading: Integers, kinds: Kinds) -> None:
    """Take over of the seen size what is in view and plausible; the rest is as usual for the kind."""
    kind, view = tracks["kind"], readings.view[seen, reading]
    more_m = readings.seen_m[seen, reading] - kinds.seen_m[kind]
    weight = np.empty_like(more_m)
    weight[:, :2] = np.where(view > _BROADSIDE, view**2, 0.0)
    weight[:, 1] *= more_m[:, 1] > 0  # mirrors are part of the width, but are rarely hit
    weight[:, 2] = np.clip(1.0 - 2.0 * readings.ring_gap_m[seen], 0.0, 1.0)
    weight *= np.abs(more_m) < _SIZE_SIGMAS * kinds.sigma_m[kind]
    weight *= np.clip(readings.points[seen] / _SURE_POINTS, 0.0, 1.0)[:, None]
    tracks["size_news"] = _SIZE_MEMORY * tracks["size_news"] + weight
    tracks["size_off_m"] = _SIZE_MEMORY * tracks["size_off_m"] + weight * more_m
    tracks["size_m"] = kinds.size_m[kind] + tracks["size_off_m"] / (1.0 + tracks["size_news"])


def _place(tracks: Table, readings: Readings, seen: Integers, reading: Integers, kinds: Kinds) -> None:
    """Complete what is seen to the object's size, away from the sensor, and correct the filter with its centre."""
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


def distances_m(tracks: Table, places_m: Floats) -> tuple[Floats, Floats]:
    """(T, C) distances of (C, 2) places from the edges of the tracks' boxes, 0 inside, and from their centres."""
    offset_m = places_m - tracks["state"][:, None, :2]
    local_m = np.einsum("tsi,tci->tcs", box_axes(tracks["yaw"]), offset_m)
    outside_m = np.maximum(np.abs(local_m) - tracks["size_m"][:, None, :2] / 2, 0.0)
    return np.linalg.norm(outside_m, axis=2), np.linalg.norm(offset_m, axis=2)
