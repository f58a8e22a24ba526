"""Points of a recorded scene's frames as baselines take them."""

from collections.abc import Sequence

import numpy as np

from simbev_ros.baselines.frames import points_of_frame, sweeps_of_frame
from simbev_ros.config.lidar import Lidar
from simbev_ros.dataset import columns
from simbev_ros.dataset.frame import Frame
from simbev_ros.dataset.scene import Scene
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.geometry.transforms import apply
from simbev_ros.foundation.types import Float32Array, Float64Array


def points_at(scene: Scene, tick: int, ages_ns: Sequence[int]) -> Float32Array:
    """(N, 4) points of the first lidar of a scene's agent, as from ``points_of_frame``; none without a newest sweep.

    Args:
        scene: The scene as the agent sees it.
        tick: The frame.
        ages_ns: Ages of the sweeps, ascending.

    Raises:
        InputError: The agent has no lidar.
        BagError: The bag is damaged.
    """
    names = [each.name for each in scene.view.rig.of_type(Lidar) if f"{each.name}/points" in scene.keys]
    if not names:
        raise InputError(f"{scene.path}: agent {scene.agent} has no lidar with points")
    ticks = np.flatnonzero(scene.has([f"{names[0]}/points"])[: tick + 1])
    sweeps = sweeps_of_frame(int(scene.stamps_ns[tick]), scene.stamps_ns[ticks], ages_ns)
    frames = [scene[int(ticks[sweep])] if sweep >= 0 else None for sweep in sweeps]
    if frames[0] is None:
        return np.zeros((0, 4), np.float32)
    ego_from_lidar = scene.calibration[names[0]].ego_from_sensor
    clouds = [None if frame is None else _cloud_ego(frame, names[0], ego_from_lidar) for frame in frames]
    return points_of_frame(clouds, [None if frame is None else frame.map_from_ego for frame in frames])


def _cloud_ego(frame: Frame, lidar: str, ego_from_lidar: Float64Array) -> Float32Array:
    """(N, 3) points of a frame, ego frame."""
    points = columns(frame[f"{lidar}/points"], "x", "y", "z").astype(np.float64)
    return apply(ego_from_lidar, points[np.isfinite(points).all(axis=1)]).astype(np.float32)
