"""Assigns answers of a perception stack to the ticks of the running scene, by stamp.

Answers to the warm-up and to other scenes are ignored; any other stamp must be that of a tick.
"""

from collections.abc import Collection

from simbev_ros.foundation.errors import InputError
from simbev_ros.schema.scene.spec import SceneSpec, scene_number_of


def answered_tick(stamp_ns: int, spec: SceneSpec, scenes: Collection[int]) -> int | None:
    """Tick that an answer belongs to; None if it belongs to the warm-up or to another of the scenes.

    Args:
        stamp_ns: Stamp of the answer.
        spec: The running scene.
        scenes: Numbers of all scenes so far, including this one.

    Raises:
        InputError: No tick has this stamp.
    """
    number = scene_number_of(stamp_ns)
    if stamp_ns < spec.start_ns if number == spec.number else number in scenes:
        return None
    tick = min(max(spec.tick_of(stamp_ns + spec.tick_ns // 2), 0), spec.ticks - 1)
    if spec.stamp_ns(tick) != stamp_ns:
        nearest = f"the nearest is {spec.stamp_ns(tick)}, that of tick {tick}"
        raise InputError(f"header.stamp: {stamp_ns} belongs to no tick of {spec.name}; {nearest}")
    return tick
