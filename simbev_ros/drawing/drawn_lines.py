"""The lines of a recorded vector map that displays draw, with their colors and widths."""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from simbev_ros.foundation.geometry.transforms import apply, matrices_from_xyz_rpy
from simbev_ros.foundation.types import Float64Array

_LIFT_M = np.array([0.0, 0.0, 0.03])
"""Height of lines above the ground, so that neither clouds nor the grid cover them."""


class DrawnLines(NamedTuple):
    """All lines of one kind.

    Attributes:
        kind: ``lane`` (centers of driving lanes), ``line`` (paint), ``edge``, ``crosswalk`` or ``stop_line``.
        color: RGB, 0..255.
        width_m: Width of a line.
        polylines_m: (N, 3) points of each line, map frame, slightly raised.
    """

    kind: str
    color: tuple[int, int, int]
    width_m: float
    polylines_m: list[Float64Array]


def drawn_lines(record: Mapping[str, Any]) -> Iterator[DrawnLines]:
    """The lines in a record of ``VectorMap.record``, kind by kind."""
    pose = record["map_from_patch"]
    map_from_patch = matrices_from_xyz_rpy(np.array(pose["translation"]), np.array([0.0, 0.0, pose["yaw"]]))
    for kind, polylines, color, width_m in (
        ("lane", _centers(record), (80, 160, 255), 0.08),
        ("line", _pieces(record, "lines"), (240, 235, 200), 0.12),
        ("edge", _pieces(record, "edges"), (230, 90, 90), 0.12),
        ("crosswalk", _rings(record), (90, 220, 160), 0.16),
        ("stop_line", _pieces(record, "stop_lines"), (255, 140, 0), 0.2),
    ):
        in_map = [apply(map_from_patch, np.array(line, np.float64).reshape(-1, 3)) + _LIFT_M for line in polylines]
        yield DrawnLines(kind, color, width_m, in_map)


def _centers(record: Mapping[str, Any]) -> Iterator[Any]:
    for lane in record["lanes"]:
        if lane["type"] == "driving":
            yield from lane["center"]


def _pieces(record: Mapping[str, Any], name: str) -> Iterator[Any]:
    for each in record[name]:
        yield from each["pieces"]


def _rings(record: Mapping[str, Any]) -> Iterator[Any]:
    """The outlines of crosswalks, closed."""
    for each in record["crosswalks"]:
        yield from ([*outline, outline[0]] for outline in each["outlines"])
