"""Number of frames between two exported ones, for layouts that have a rate of their own."""

from simbev_ros.dataset import Scene
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.units import NS_PER_S

_TOLERANCE_HZ = 1e-6


def frame_period(scene: Scene, rate_hz: float, parameter: str) -> int:
    """Number of frames from one exported frame of a scene to the next.

    Args:
        scene: The scene.
        rate_hz: Number of exported frames per second.
        parameter: Name of the setting that the rate comes from, for the message.

    Raises:
        InputError: The rate does not divide that of the scene's frames, or that of its labels.
    """
    tick_hz, labels = NS_PER_S / scene.spec.tick_ns, scene.view.label_period_ticks()
    period = round(tick_hz / rate_hz)
    if period < 1 or abs(tick_hz / period - rate_hz) > _TOLERANCE_HZ or period % labels:
        frames = f"{tick_hz:g} frames/s" if labels == 1 else f"{tick_hz / labels:g} frames/s with labels"
        raise InputError(f"{rate_hz:g} does not divide the {frames} of {scene.path}", parameter=parameter)
    return period
