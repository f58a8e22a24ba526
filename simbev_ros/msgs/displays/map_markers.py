"""Markers of the vector map: lanes, painted lines, edges of paved ground, crosswalks and stop lines."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from simbev_ros.geometry.transforms import apply, matrices_from_xyz_rpy
from simbev_ros.msgs.displays.markers import lines, replacing_markers
from simbev_ros.msgs.displays.messages import MAP_FRAME, color, stamped
from simbev_ros.types import Float64Array

_LIFT_M = 0.03
"""Height of lines above the ground, so that neither clouds nor the grid cover them."""


def map_markers(record: Mapping[str, Any], stamp_ns: int) -> bytes:
    """MarkerArray with one marker for each kind of line of a vector map that occurs; its namespace names the kind.

    Traffic lights and signs are not repeated: those around the ego are among the boxes.

    Args:
        record: The record of ``VectorMap.record``.
        stamp_ns: Stamp of all markers, which are in the map frame.
    """
    pose = record["map_from_patch"]
    map_from_patch = matrices_from_xyz_rpy(np.array(pose["translation"]), np.array([0.0, 0.0, pose["yaw"]]))
    header, markers = stamped(stamp_ns, MAP_FRAME), list[Any]()
    for name, polylines, rgb, width_m in (
        ("lane", _centers(record["lanes"]), (80, 160, 255), 0.08),
        ("line", _pieces(record["lines"]), (240, 235, 200), 0.12),
        ("edge", _pieces(record["edges"]), (230, 90, 90), 0.12),
        ("crosswalk", _rings(record["crosswalks"]), (90, 220, 160), 0.16),
        ("stop_line", _pieces(record["stop_lines"]), (255, 140, 0), 0.2),
    ):
        starts_m, ends_m = _segments(polylines, map_from_patch)
        markers += lines(header, name, starts_m, ends_m, color(rgb), width_m)
    return replacing_markers(header, markers)


def _centers(lanes: Sequence[Mapping[str, Any]]) -> Iterator[Any]:
    for lane in lanes:
        if lane["type"] == "driving":
            yield from lane["center"]


def _pieces(objects: Sequence[Mapping[str, Any]]) -> Iterator[Any]:
    for each in objects:
        yield from each["pieces"]


def _rings(objects: Sequence[Mapping[str, Any]]) -> Iterator[Any]:
    """The outlines, closed."""
    for each in objects:
        yield from ([*outline, outline[0]] for outline in each["outlines"])


def _segments(polylines: Iterator[Any], map_from_patch: Float64Array) -> tuple[Float64Array, Float64Array]:
    """(N, 3) both ends of all segments, map frame, slightly raised."""
    starts, ends = [np.zeros((0, 3))], [np.zeros((0, 3))]
    for polyline in polylines:
        line_m = apply(map_from_patch, np.array(polyline, np.float64))
        line_m[:, 2] += _LIFT_M
        starts.append(line_m[:-1])
        ends.append(line_m[1:])
    return np.concatenate(starts), np.concatenate(ends)
