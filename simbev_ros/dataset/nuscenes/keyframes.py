"""Selects the keyframes of a scene, which become nuScenes' samples, and the sensor data of each keyframe."""

import numpy as np

from simbev_ros.dataset import Scene
from simbev_ros.dataset.frame_period import frame_period
from simbev_ros.dataset.nuscenes.channels import Channel, channels_of
from simbev_ros.foundation.errors import BagError
from simbev_ros.foundation.types import Int64Array

_MOTION_KEYS = ("odom", "world/actors")
_REQUIRED_KEYS = ("boxes", *_MOTION_KEYS)


def complete_ticks(scene: Scene) -> Int64Array:
    """(T,) ticks of the frames that have all data that the tables need; tick 0 is the first keyframe.

    Raises:
        BagError: There is no such frame, or the bag lacks a topic that all frames need.
    """
    missing = [key for key in _REQUIRED_KEYS if key not in scene.sources]
    if missing or "world/legend" not in scene.constants:
        raise BagError(f"{scene.path}: no {', '.join(missing) or 'world/legend'} in it, which nuScenes' tables need")
    ticks = np.flatnonzero(scene.has(_REQUIRED_KEYS))
    if not len(ticks) or ticks[0] != 0 or not channels_of(scene):
        raise BagError(f"{scene.path}: its first frame is not whole, or no camera, lidar or radar was recorded")
    return np.asarray(ticks, np.int64)


def swept_ticks(scene: Scene) -> Int64Array:
    """(T,) ticks of the frames of which sensor data can be exported: they need no boxes, unless they are keyframes."""
    return np.flatnonzero(scene.has(_MOTION_KEYS))


def keyframes_of(scene: Scene, keyframe_hz: float | None) -> Int64Array:
    """(K,) ticks of the keyframes of a scene at a rate; None: every complete frame is a keyframe.

    Raises:
        InputError: The rate does not divide that of the scene's frames.
        BagError: As for ``complete_ticks``.
    """
    ticks = complete_ticks(scene)
    period = 1 if keyframe_hz is None else frame_period(scene, keyframe_hz, "keyframe_hz")
    return np.compress(ticks % period == 0, ticks)


def keyframe_by_tick(scene: Scene, channel: Channel, ticks: Int64Array) -> dict[int, int]:
    """Ticks of keyframes by the ticks of a channel's data that belong to them.

    A keyframe has the channel's data of its own tick; if there are none, the last data before it, unless they already
    belong to an earlier keyframe.
    """
    own = np.flatnonzero(scene.has([channel.key]))
    latest = np.searchsorted(own, ticks, side="right") - 1
    taken, first = np.unique(latest, return_index=True)
    return {int(own[index]): int(ticks[k]) for index, k in zip(taken, first, strict=True) if index >= 0}
