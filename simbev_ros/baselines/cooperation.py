"""Cooperation of agents that run the lidar baseline: early fusion of points, and intermediate fusion of features.

For intermediate fusion, the network is cut where it knows of each cell of its grid only the points within. Agents send
the features of the cells in which they have points; where several have some, the maximum counts, as in F-Cooper
(https://arxiv.org/abs/1909.06459). The rest of the network takes fused features without having been trained on them,
if features mean the same for all agents. So a sender moves its points into the level frame of the receiver first, as in
OPV2V (https://arxiv.org/abs/2109.07644): features depend on heights, and on where in a cell the points lie.
"""

import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from simbev_ros.baselines.grid import CELL_M, CELLS, HALF_M, level_from_map
from simbev_ros.baselines.inference import Answer, decode_answer, open_session
from simbev_ros.foundation.geometry.transforms import apply, inverse
from simbev_ros.foundation.types import Float32Array, Float64Array, Int64Array, UInt8Array

_FAR_BELOW = np.array([[0.0, 0.0, -1000.0, 0.0]], np.float32)
"""A point that is in no cell."""
_STEPS = 255.0
_CM_PER_M = 100.0
_OUTPUTS = ("cells", "heat", "boxes", "small_heat", "small_boxes")


@dataclass(frozen=True, eq=False)
class CellFeatures:
    """Features of the cells of one agent's grid in which it has points.

    Attributes:
        cells: (N,) cells, ascending: row times ``CELLS`` plus column, in some level frame.
        values: (N, C) their features, 0 or above.
    """

    cells: Int64Array
    values: Float32Array

    def sent(self) -> tuple["CellFeatures", int]:
        """The features as a message with 8 bits for each value has them, and the message's size in bytes."""
        scale = np.maximum(self.values.max(axis=0, initial=0.0), 1e-6) / np.float32(_STEPS)
        steps: UInt8Array = np.rint(self.values / scale).astype(np.uint8)
        gaps = np.diff(self.cells, prepend=0).astype(np.uint32)
        size = sum(len(zlib.compress(part.tobytes())) for part in (gaps, steps.T, scale))
        return CellFeatures(self.cells, steps * scale), size


class TwoPartBaseline:
    """A lidar baseline that has been cut, so that features can be exchanged in between.

    Args:
        path: Its ONNX file.
        parts: The two parts, from ``simbev_training.training.parts.cut_model``.
        threads: Threads on the CPU; None: one for each core.

    Raises:
        InputError: ONNX Runtime is not installed, or a part cannot be loaded.
    """

    def __init__(self, path: Path, parts: tuple[bytes, bytes], threads: int | None = None) -> None:
        self._first, self._last = (open_session(path, threads, part=part) for part in parts)
        self._input = str(self._last.get_inputs()[0].name)
        self._empty = self._features(_FAR_BELOW)[:, :1]

    def encode(self, points: Float32Array) -> CellFeatures:
        """Features of an agent's points (N, 4), as for ``Baseline.answer``."""
        features = self._features(points if len(points) else _FAR_BELOW)
        cells = np.flatnonzero((features != self._empty).any(axis=0))
        return CellFeatures(cells, features[:, cells].T)

    def answer(self, features: CellFeatures) -> Answer:
        """The answer to features, which may be fused."""
        dense = np.repeat(self._empty, CELLS * CELLS, axis=1)
        dense[:, features.cells] = features.values.T
        outputs = self._last.run([*_OUTPUTS], {self._input: dense.reshape(1, -1, CELLS, CELLS)})
        return decode_answer(*outputs)

    def _features(self, points: Float32Array) -> Float32Array:
        """(C, CELLS²) features of all cells."""
        [features] = self._first.run(None, {"points": np.ascontiguousarray(points, np.float32)})
        result: Float32Array = features.reshape(features.shape[1], -1)
        return result


def level_from_level(map_from_ego: Float64Array, map_from_other: Float64Array) -> Float64Array:
    """(4, 4) transform to an agent's level frame from that of another one, given their poses in the map."""
    return level_from_map(map_from_ego) @ inverse(level_from_map(map_from_other))


def fuse_features(own: CellFeatures, received: Sequence[tuple[CellFeatures, Float64Array]]) -> CellFeatures:
    """Features of all agents on the grid of one of them: the maximum where several have points in a cell.

    A cell takes the features of that cell of another grid in which its center is.

    Args:
        own: Features of the agent.
        received: Those of others, each with the (4, 4) transform to the agent's level frame from that of the features.
    """
    fused = np.full((CELLS * CELLS, own.values.shape[1]), -np.inf, np.float32)
    fused[own.cells] = own.values
    ahead_m = HALF_M - (np.arange(CELLS) + 0.5) * CELL_M
    centers_m = np.stack([*np.meshgrid(ahead_m, ahead_m, indexing="ij"), np.zeros((CELLS, CELLS))], -1).reshape(-1, 3)
    for features, own_from_other in received:
        there_m = apply(inverse(own_from_other), centers_m)[:, :2]
        row, column = np.floor((HALF_M - there_m.T) / CELL_M).astype(np.int64)
        index = np.full(CELLS * CELLS + 1, -1, np.int64)
        index[features.cells] = np.arange(len(features.cells))
        inside = (row >= 0) & (row < CELLS) & (column >= 0) & (column < CELLS)
        source = index[np.where(inside, row * CELLS + column, CELLS * CELLS)]
        has_points = np.flatnonzero(source >= 0)
        fused[has_points] = np.maximum(fused[has_points], features.values[source[has_points]])
    cells = np.flatnonzero(fused[:, 0] >= 0)
    return CellFeatures(cells, fused[cells])


def moved_points(points: Float32Array, target_from_source: Float64Array) -> Float32Array:
    """Points (N, 4) with indices of sweeps in another frame."""
    moved = apply(target_from_source, points[:, :3].astype(np.float64))
    return np.column_stack([moved, points[:, 3]]).astype(np.float32)


def points_message_bytes(points: Float32Array) -> int:
    """Size of a message with the newest sweep of an agent's points (N, 4), within its grid, in steps of 1 cm."""
    newest = points[(points[:, 3] == 0) & (np.abs(points[:, :2]) < HALF_M).all(axis=1), :3]
    steps = np.rint(newest * _CM_PER_M).astype(np.int16)
    return len(zlib.compress(np.diff(steps, axis=0, prepend=np.zeros((1, 3), np.int16)).T.tobytes()))
