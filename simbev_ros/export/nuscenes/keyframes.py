"""Selects the keyframes of a scene, which become nuScenes' samples, and the sensor data of each keyframe."""

import numpy as np

from simbev_ros.dataset import Scene
from simbev_ros.errors import BagError, InputError
from simbev_ros.export.nuscenes.channels import Channel, channels_of
from simbev_ros.types import Int64Array
from simbev_ros.units import NS_PER_S

_REQUIRED_KEYS = ("boxes", "odom", "world/actors")
_TOLERANCE_HZ = 1e-6


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


def keyframes_of(scene: Scene, keyframe_hz: float | None) -> Int64Array:
    """(K,) ticks of the keyframes of a scene at a rate; None: every complete frame is a keyframe.

    Raises:
        InputError: The rate does not divide that of the scene's frames.
        BagError: As for ``complete_ticks``.
    """
    ticks, period = complete_ticks(scene), _period(scene, keyframe_hz)
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


def _period(scene: Scene, keyframe_hz: float | None) -> int:
    """Number of frames from one keyframe to the next."""
    if keyframe_hz is None:
        return 1
    tick_hz = NS_PER_S / scene.spec.tick_ns
    period = round(tick_hz / keyframe_hz)
    if period < 1 or abs(tick_hz / period - keyframe_hz) > _TOLERANCE_HZ:
        raise InputError(
            f"{keyframe_hz:g} is no divisor of the {tick_hz:g} frames/s of {scene.path}", parameter="keyframe_hz"
        )
    return period
