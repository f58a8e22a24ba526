"""Markers of the vector map: lanes, painted lines, edges of paved ground, crosswalks and stop lines."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from simbev_ros.drawing.displays.markers import lines, replacing_markers
from simbev_ros.drawing.displays.messages import MAP_FRAME, color, stamped
from simbev_ros.drawing.drawn_lines import drawn_lines
from simbev_ros.foundation.types import Float64Array


def map_markers(record: Mapping[str, Any], stamp_ns: int) -> bytes:
    """MarkerArray with one marker for each kind of line of a vector map that occurs; its namespace names the kind.

    Traffic lights and signs are not repeated: those around the ego are among the boxes.

    Args:
        record: The record of ``VectorMap.record``.
        stamp_ns: Stamp of all markers, which are in the map frame.
    """
    header, markers = stamped(stamp_ns, MAP_FRAME), list[Any]()
    for drawn in drawn_lines(record):
        starts_m, ends_m = _segments(drawn.polylines_m)
        markers += lines(header, drawn.kind, starts_m, ends_m, color(drawn.color), drawn.width_m)
    return replacing_markers(header, markers)


def _segments(polylines_m: Sequence[Float64Array]) -> tuple[Float64Array, Float64Array]:
    """(N, 3) both ends of all segments."""
    none = [np.zeros((0, 3))]
    return (
        np.concatenate(none + [line_m[:-1] for line_m in polylines_m]),
        np.concatenate(none + [line_m[1:] for line_m in polylines_m]),
    )
