"""Which frame of a running scene an answer is to, by its stamp."""

from collections.abc import Collection

from simbev_ros.errors import InputError
from simbev_ros.scene.spec import SceneSpec, scene_number_of


def answered_tick(stamp_ns: int, spec: SceneSpec, scenes: Collection[int]) -> int | None:
    """The tick that an answer is to; None: it is one of the lead-in, or of another of the scenes.

    Args:
        stamp_ns: Of the answer.
        spec: The scene that runs.
        scenes: Numbers of all scenes so far, of this one too.

    Raises:
        InputError: The stamp is that of no tick.
    """
    number = scene_number_of(stamp_ns)
    if stamp_ns < spec.start_ns if number == spec.number else number in scenes:
        return None
    tick = min(max(spec.tick_of(stamp_ns + spec.tick_ns // 2), 0), spec.ticks - 1)
    if spec.stamp_ns(tick) != stamp_ns:
        nearest = f"the nearest is {spec.stamp_ns(tick)}, that of tick {tick}"
        raise InputError(f"header.stamp: {stamp_ns} is that of no tick of {spec.name}; {nearest}")
    return tick
