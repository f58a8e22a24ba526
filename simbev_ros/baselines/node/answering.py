"""Answers frames with a baseline: what comes from sensors becomes the model's input, its output what is published."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from simbev_ros.baselines.boxes import BOX_DTYPE as MODEL_BOX_DTYPE
from simbev_ros.baselines.boxes import boxes_in_map
from simbev_ros.baselines.frames import points_of_frame, projections
from simbev_ros.baselines.grid import CELL_M, CELLS, HALF_M
from simbev_ros.baselines.inference import Baseline
from simbev_ros.baselines.node.image_fit import ImageFit
from simbev_ros.baselines.node.scene_inputs import SceneInputs, stacked_projections
from simbev_ros.baselines.node.sweeps import Sweep
from simbev_ros.baselines.tracker import Tracker
from simbev_ros.evaluation.metrics.boxes import NO_TRACK
from simbev_ros.foundation.geometry.grid import BevGrid
from simbev_ros.foundation.types import Float32Array, Float64Array, Table, UInt8Array
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.reference_stack.pipeline import BOX_DTYPE

ReadImage = Callable[[ImageFit], UInt8Array]
"""Gives an image (H, W, 3), RGB, in the model's size."""


@dataclass(frozen=True, eq=False)
class Frame:
    """A frame to answer.

    Attributes:
        stamp_ns: Its stamp.
        map_from_ego: (4, 4) pose of the ego.
        sweeps: Its sweeps, newest first; empty: the model sees no lidar.
        images: How to read the images, by camera.
    """

    stamp_ns: int
    map_from_ego: Float64Array
    sweeps: Sequence[Sweep | None]
    images: Mapping[str, ReadImage]


@dataclass(frozen=True, eq=False)
class FrameAnswer:
    """Messages that are published for a frame.

    Attributes:
        boxes: (N,) ``BOX_DTYPE``, map frame.
        scores: (rows, columns, classes) uint8 scores of the scene's grid, 255 is 1.
    """

    boxes: Table
    scores: UInt8Array


class Answering:
    """Answers the frames of one scene in the order of their stamps.

    Args:
        baseline: The model.
        inputs: What the scene sends.
        tracks: Whether to track boxes, which gives them ids and the velocities of their tracks.
    """

    def __init__(self, baseline: Baseline, inputs: SceneInputs, *, tracks: bool = False) -> None:
        self._baseline, self._inputs = baseline, inputs
        self._tracker = Tracker() if tracks else None

    def answer(self, frame: Frame) -> FrameAnswer:
        """Answer a frame.

        Raises:
            ValueError: An image is damaged.
        """
        points = _points(frame.sweeps) if frame.sweeps else None
        images, pixel_from_level = self._camera_inputs(frame) if self._inputs.cameras else (None, None)
        answer = self._baseline.answer(points, images, pixel_from_level)
        boxes = boxes_in_map(answer.boxes, frame.map_from_ego)
        published = np.zeros(len(boxes), BOX_DTYPE)
        for name in MODEL_BOX_DTYPE.names or ():
            published[name] = boxes[name]
        published["id"] = NO_TRACK
        if self._tracker is not None:
            tracked = self._tracker.step(boxes, frame.stamp_ns / NS_PER_S)
            published["id"], (published["vx"], published["vy"]) = tracked.id, tracked.velocity_mps.T
        return FrameAnswer(published, scores_on_grid(answer.cells, self._inputs.grid))

    def _camera_inputs(self, frame: Frame) -> tuple[UInt8Array, Float32Array]:
        """Images and projections for all cameras of the model; those that the rig lacks are black and see nothing."""
        cameras = self._inputs.cameras
        width_px, height_px = self._baseline.camera_size_px or (0, 0)
        images = np.zeros((self._baseline.cameras, height_px, width_px, 3), np.uint8)
        for image, (name, camera) in zip(images, cameras.items(), strict=False):
            image[:] = frame.images[name](camera.fit)
        pixel_from_level = np.zeros((len(images), 3, 4), np.float32)
        pixel_from_ego = stacked_projections(list(cameras.values()))
        pixel_from_level[: len(cameras)] = projections(pixel_from_ego, frame.map_from_ego)
        return images, pixel_from_level


def scores_on_grid(cells: UInt8Array, grid: BevGrid | None) -> UInt8Array:
    """Scores on the grid of a scene: each cell has those of the model's cell around its center, 0 where there is none.

    Args:
        cells: (CELLS, CELLS, classes) scores.
        grid: Grid of the scene; None: the model's.
    """
    if grid is None or (grid.rows, grid.columns, grid.cell_m) == (CELLS, CELLS, CELL_M):
        return cells
    centers_m = grid.centers_ego
    rows = np.floor((HALF_M - centers_m[:, 0, 0]) / CELL_M).astype(np.int64)
    columns = np.floor((HALF_M - centers_m[0, :, 1]) / CELL_M).astype(np.int64)
    to_rows, to_columns = (np.flatnonzero((each >= 0) & (each < CELLS)) for each in (rows, columns))
    scores = np.zeros((grid.rows, grid.columns, cells.shape[2]), np.uint8)
    scores[np.ix_(to_rows, to_columns)] = cells[np.ix_(rows[to_rows], columns[to_columns])]
    return scores


def _points(sweeps: Sequence[Sweep | None]) -> Float32Array:
    """(N, 4) points of a frame with the index of their sweep, level frame."""
    return points_of_frame(
        [None if sweep is None else sweep.points_ego for sweep in sweeps],
        [None if sweep is None else sweep.map_from_ego for sweep in sweeps],
    )
