"""Markers for RViz and Foxglove: the parts that boxes, actors and vector maps have in common."""

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from simbev_ros.drawing.displays.messages import build, points, pose, vector
from simbev_ros.drawing.displays.serialized_markers import Lines, serialized_markers
from simbev_ros.foundation.types import Float64Array

CUBE, SPHERE, LINE_LIST, SPHERE_LIST = 1, 2, 5, 7
"""Values of Marker.type."""
_DELETE_ALL = 3

_UPRIGHT = [0.0, 0.0, 0.0, 1.0]


def replacing_markers(header: Any, parts: Iterable[Any]) -> bytes:
    """MarkerArray in which a DELETEALL comes before the markers.

    It removes markers that have disappeared, so none needs a lifetime, which would run out if a simulation is paused or
    slower than its clock.

    Args:
        header: Header of the markers.
        parts: Marker messages, ``Solids`` and ``Lines``.
    """
    first = build("visualization_msgs/msg/Marker", header=header, action=_DELETE_ALL)
    return serialized_markers(header, [first, *parts])


def balls(header: Any, name: str, centers_m: Float64Array, colors: list[Any], size_m: float) -> Iterator[Any]:
    """One marker with a ball at each of (N, 3) points; no marker if there are none."""
    if len(centers_m):
        yield build(
            "visualization_msgs/msg/Marker",
            header=header,
            ns=name,
            type=SPHERE_LIST,
            pose=pose([0.0, 0.0, 0.0], _UPRIGHT),
            scale=vector(size_m, size_m, size_m),
            color=colors[0],
            points=points(centers_m),
            colors=colors,
        )


def lines(
    header: Any, name: str, starts_m: Float64Array, ends_m: Float64Array, color: Any, width_m: float
) -> Iterator[Lines]:
    """One marker with a line between each pair of (N, 3) points; no marker if there are none."""
    if len(starts_m):
        marker = build(
            "visualization_msgs/msg/Marker",
            header=header,
            ns=name,
            type=LINE_LIST,
            pose=pose([0.0, 0.0, 0.0], _UPRIGHT),
            scale=vector(width_m, width_m, width_m),
            color=color,
        )
        yield Lines(marker, np.stack([starts_m, ends_m], axis=1).reshape(-1, 3))
