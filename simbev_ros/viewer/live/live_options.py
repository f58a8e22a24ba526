"""Options of the viewer of running graphs. Pure: imports neither ROS nor Rerun."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class LiveOptions:
    """What is shown, and how often.

    Attributes:
        rate_hz: Maximum number of frames per second of wall time.
        max_points: Maximum number of points of a cloud.
        layers: Whether to show what is hidden until it is switched on too.
    """

    rate_hz: float
    max_points: int
    layers: bool
