"""Draws the vector map: lanes, painted lines, edges of paved ground, crosswalks and stop lines around the ego."""

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
import rerun as rr

from simbev_ros.geometry.transforms import apply, matrices_from_xyz_rpy
from simbev_ros.types import Float64Array
from simbev_ros.viewer.scene_log import WORLD, SceneLog
from simbev_ros.viewer.subject import Samples

VECTOR_MAP = f"{WORLD}/vector_map"
_LIFT_M = 0.03
"""Height of lines above the ground, which lidar points would cover otherwise."""


_Polylines = Callable[[Mapping[str, Any]], Iterator[Any]]


def _centers(record: Mapping[str, Any]) -> Iterator[Any]:
    for lane in record["lanes"]:
        if lane["type"] == "driving":
            yield from lane["center"]


def _pieces(name: str) -> _Polylines:
    def pieces(record: Mapping[str, Any]) -> Iterator[Any]:
        for each in record[name]:
            yield from each["pieces"]

    return pieces


def _outlines(record: Mapping[str, Any]) -> Iterator[Any]:
    for each in record["crosswalks"]:
        for outline in each["outlines"]:
            yield [*outline, outline[0]]


_KINDS: Mapping[str, tuple[_Polylines, tuple[int, int, int], float]] = {
    "lanes": (_centers, (80, 160, 255), 0.05),
    "lines": (_pieces("lines"), (240, 235, 200), 0.07),
    "edges": (_pieces("edges"), (230, 90, 90), 0.07),
    "crosswalks": (_outlines, (90, 220, 160), 0.09),
    "stop_lines": (_pieces("stop_lines"), (255, 140, 0), 0.12),
}
"""Polylines of a record, color and radius in meters, by entity."""


class VectorMapDrawing:
    """Draws the vector map, one entity for each kind of line."""

    def __init__(self, log: SceneLog) -> None:
        self._log = log

    def draw(self, samples: Samples) -> None:
        """Log the lines."""
        if "vector_map" not in samples:
            return
        record = samples["vector_map"]
        pose = record["map_from_patch"]
        map_from_patch = matrices_from_xyz_rpy(np.array(pose["translation"]), np.array([0.0, 0.0, pose["yaw"]]))
        for kind, (polylines, color, radius_m) in _KINDS.items():
            lines = [_in_map(map_from_patch, line) for line in polylines(record)]
            self._log.add(f"{VECTOR_MAP}/{kind}", rr.LineStrips3D(lines, colors=color, radii=radius_m))


def _in_map(map_from_patch: Float64Array, line: Any) -> Float64Array:
    """(N, 3) points of a line in the map frame, slightly raised."""
    return apply(map_from_patch, np.array(line, np.float64).reshape(-1, 3)) + np.array([0.0, 0.0, _LIFT_M])
