"""Facts about frames that training and the live stack share: earlier sweeps, poses and projections."""

from collections.abc import Sequence

import numpy as np

from simbev_ros.baselines.grid import level_from_map
from simbev_ros.foundation.types import Float32Array, Float64Array, Int64Array
from simbev_ros.foundation.units import NS_PER_S

IMAGE_STRIDE = 8
"""Pixels in one cell of an image's features, along each axis; such a patch has one depth in a cache."""
_TOLERANCE_NS = 60_000_000
_NO_SWEEP = -1


def sweep_ages_ns(ages_s: Sequence[float]) -> tuple[int, ...]:
    """Ages of sweeps in ns."""
    return tuple(round(each * NS_PER_S) for each in ages_s)


def sweeps_of_frame(stamp_ns: int, sweep_stamps_ns: Int64Array, ages_ns: Sequence[int]) -> list[int]:
    """Index of the sweep of each age; -1 where there is none, as in a scene's first frames.

    Args:
        stamp_ns: Stamp of the frame.
        sweep_stamps_ns: (S,) stamps of all sweeps, ascending.
        ages_ns: Ages of the sweeps, ascending.
    """
    chosen = []
    for age_ns in ages_ns:
        wanted_ns = stamp_ns - age_ns
        nearest = int(np.abs(sweep_stamps_ns - wanted_ns).argmin()) if len(sweep_stamps_ns) else _NO_SWEEP
        is_near = nearest >= 0 and abs(int(sweep_stamps_ns[nearest]) - wanted_ns) <= _TOLERANCE_NS
        chosen.append(nearest if is_near and nearest not in chosen else _NO_SWEEP)
    return chosen


def points_of_frame(
    sweeps_ego: Sequence[Float32Array | None], map_from_ego: Sequence[Float64Array | None]
) -> Float32Array:
    """(N, 4) x, y, z (m, level frame of the newest sweep) and index of the sweep of all points of a frame.

    Args:
        sweeps_ego: Points (N, 3) of each sweep in the ego frame of its own stamp, newest first; None: no such sweep.
        map_from_ego: (4, 4) pose of the ego at the stamp of each sweep.
    """
    if map_from_ego[0] is None:
        raise ValueError("a frame needs its newest sweep")
    level = level_from_map(map_from_ego[0])
    parts = [np.zeros((0, 4), np.float32)]
    for index, (points, pose) in enumerate(zip(sweeps_ego, map_from_ego, strict=True)):
        if points is not None and pose is not None:
            level_from_ego = level @ pose
            moved = points @ level_from_ego[:3, :3].T.astype(np.float32) + level_from_ego[:3, 3].astype(np.float32)
            parts.append(np.column_stack([moved, np.full(len(moved), index, np.float32)]))
    return np.concatenate(parts)


def projections(pixel_from_ego: Float64Array, map_from_ego: Float64Array) -> Float32Array:
    """(K, 3, 4) projections from the level frame to u * depth, v * depth and depth in pixels and m.

    Args:
        pixel_from_ego: (K, 3, 4) the same from the ego frame.
        map_from_ego: (4, 4) pose of the ego.
    """
    ego_from_level = np.linalg.inv(level_from_map(map_from_ego) @ map_from_ego)
    return np.asarray(pixel_from_ego @ ego_from_level, np.float32)
