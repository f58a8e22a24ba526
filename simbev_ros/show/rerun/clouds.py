"""Draws point clouds: lidars by intensity, ring, height and class, radars by Doppler velocity, and occupied voxels."""

from collections.abc import Callable, Collection, Mapping

import cv2
import numpy as np
import rerun as rr

from simbev_ros.dataset.values import columns
from simbev_ros.drawing.panels import doppler_color
from simbev_ros.foundation.types import AnyArray, BoolArray, Table, UInt8Array
from simbev_ros.schema.palette import semantic_color
from simbev_ros.show.rerun.scene_log import EGO, SceneLog
from simbev_ros.show.rerun.strokes import LIDAR_POINT, RADAR_POINT
from simbev_ros.show.rerun.subject import Samples, Subject

_HEIGHT_RANGE_M = (-3.0, 5.0)
"""Heights above the sensor that get the first and the last color."""


def _by_intensity(points: Table) -> UInt8Array:
    return _colormap(np.sqrt(np.maximum(points["intensity"], 0.0)))


def _by_ring(points: Table) -> UInt8Array:
    return _colormap(points["ring"] / max(int(points["ring"].max(initial=0)), 1))


def _by_height(points: Table) -> UInt8Array:
    low_m, high_m = _HEIGHT_RANGE_M
    return _colormap((points["z"] - low_m) / (high_m - low_m))


def _by_class(points: Table) -> UInt8Array:
    return semantic_color(points["tag"].astype(np.uint8))


_COLORINGS: Mapping[str, Mapping[str, Callable[[Table], UInt8Array]]] = {
    "points": {"intensity": _by_intensity, "ring": _by_ring, "height": _by_height},
    "semantic_points": {"class": _by_class},
}
"""Colors of points, by entity, for each of a lidar's topics."""
COLORINGS = tuple(name for names in _COLORINGS.values() for name in names)
"""Ways to color a lidar's points; each is an entity."""
FIRST_COLORING = "height"
"""The one that is shown until another one is switched on."""


class LidarDrawing:
    """Draws a lidar's points, once for each of the ways to color them."""

    def __init__(self, log: SceneLog, subject: Subject, name: str, colorings: Collection[str]) -> None:
        self._log, self._name = log, name
        self._max_points = subject.detail.max_points // (1 if FIRST_COLORING in colorings else 2)
        self._colorings = {
            topic: {coloring: color for coloring, color in known.items() if coloring in colorings}
            for topic, known in _COLORINGS.items()
        }

    def draw(self, samples: Samples) -> None:
        """Log the points."""
        for topic, colorings in self._colorings.items():
            if not colorings or (key := f"{self._name}/{topic}") not in samples:
                continue
            points = thin_out(samples[key], self._max_points)
            for coloring, color in colorings.items():
                self._log.add(
                    f"{EGO}/{self._name}/{coloring}",
                    rr.Points3D(columns(points, "x", "y", "z"), colors=color(points), radii=LIDAR_POINT),
                )


class RadarDrawing:
    """Draws a radar's detections: blue ones approach, red ones recede."""

    def __init__(self, log: SceneLog, subject: Subject, name: str) -> None:
        self._log, self._name, self._max_points = log, name, subject.detail.max_points

    def draw(self, samples: Samples) -> None:
        """Log the detections."""
        if (key := f"{self._name}/points") in samples:
            points = thin_out(samples[key], self._max_points)
            self._log.add(
                f"{EGO}/{self._name}/doppler",
                rr.Points3D(
                    columns(points, "x", "y", "z"),
                    colors=doppler_color(points["doppler_velocity"]),
                    radii=RADAR_POINT,
                ),
            )


class OccupancyDrawing:
    """Draws the occupied voxels that have a free side; the others cannot be seen."""

    def __init__(self, log: SceneLog, subject: Subject) -> None:
        self._log, self._section = log, subject.view.annotation.occupancy

    def draw(self, samples: Samples) -> None:
        """Log the voxels."""
        if self._section is None or "occupancy/points" not in samples:
            return
        voxels = samples["occupancy/points"]
        grid = self._section.grid
        indices = columns(voxels, "ix", "iy", "iz").astype(np.int32)
        outer = has_free_side(indices, grid.shape)
        self._log.add(
            f"{EGO}/occupancy",
            rr.VoxelGridMap(
                indices[outer],
                [grid.voxel_m] * 3,
                colors=semantic_color(voxels["tag"][outer]),
                translation=grid.low_m,
            ),
        )


def thin_out(points: Table, max_points: int) -> Table:
    """Every Nth of (P,) points, with the smallest N that leaves at most ``max_points``."""
    return points[:: max(1, -(-len(points) // max_points))]


def has_free_side(indices: AnyArray, shape: tuple[int, int, int]) -> BoolArray:
    """(N,) whether one of the six neighbors of each of (N, 3) occupied voxels of a grid is not occupied."""
    occupied = np.zeros([size + 2 for size in shape], np.bool_)
    x, y, z = (indices + 1).T
    occupied[x, y, z] = True
    free = np.zeros(len(indices), np.bool_)
    for axis in range(3):
        for side in (-1, 1):
            step = np.zeros(3, np.int64)
            step[axis] = side
            free |= ~occupied[x + step[0], y + step[1], z + step[2]]
    return free


def _colormap(share: AnyArray) -> UInt8Array:
    """(N, 3) Turbo colors of (N,) numbers, clipped to 0..1."""
    levels = np.rint(20 + 225 * np.clip(share, 0.0, 1.0)).astype(np.uint8)  # the ends of Turbo are nearly black
    return _turbo()[levels]


def _turbo() -> UInt8Array:
    """(256, 3) colors."""
    table = cv2.applyColorMap(np.arange(256, dtype=np.uint8), cv2.COLORMAP_TURBO)
    return np.asarray(table.reshape(-1, 3)[:, ::-1], np.uint8)
