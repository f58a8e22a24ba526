"""Draws the bird's-eye-view cells of single frames as SVG: ground truth, prediction, and their difference.

A frame and a ``ScoreGrid`` enter; SVG text leaves.
"""

import numpy as np

from simbev_ros.dataset import Frame
from simbev_ros.evaluation.metrics.segmentation import TABLE_THRESHOLD, thresholds_in_dtype
from simbev_ros.evaluation.predictions.score_grid import ScoreGrid
from simbev_ros.foundation.semantics import BEV_CLASSES
from simbev_ros.foundation.types import AnyArray, BoolArray, UInt8Array, UInt16Array
from simbev_ros.schema.palette import bev_color
from simbev_ros.show.reports.svg_drawing import Color, Drawing

RIGHT: Color = (128, 140, 152)
MISSED: Color = (224, 53, 47)
FALSE: Color = (224, 154, 18)
_SIDE = 360.0
_RIGHT_OPACITY = 90


def grid_pictures(frame: Frame, predicted: ScoreGrid, classes: tuple[str, ...]) -> dict[str, str]:
    """SVG pictures of a frame's cells by what they show, the ego in the middle, facing up.

    Args:
        frame: The frame, with the ground truth.
        predicted: Predicted scores of the frame.
        classes: The evaluated classes.
    """
    chosen = sum(1 << BEV_CLASSES.index(name) for name in classes)
    truth = frame["bev/labels"] & np.uint16(chosen)
    answer = _labels(predicted) & np.uint16(chosen)
    missed, false = truth & ~answer != 0, answer & ~truth != 0
    return {
        "truth": _svg(*_indexed(bev_color(truth), truth == 0)),
        "predicted": _svg(*_indexed(bev_color(answer), answer == 0)),
        "difference": _svg(*_difference(truth != 0, missed, false)),
    }


def _labels(predicted: ScoreGrid) -> UInt16Array:
    """(H, W) uint16 labels, bit k for class k, set where scores are above the threshold of the tables."""
    (limit,) = thresholds_in_dtype((TABLE_THRESHOLD,), predicted.scores.dtype)
    labels = np.zeros(predicted.scores.shape[1:], np.uint16)
    for name, scores in zip(predicted.classes, predicted.scores, strict=True):
        labels |= (scores > limit).astype(np.uint16) << np.uint16(BEV_CLASSES.index(name))
    return labels


def _indexed(colors: UInt8Array, empty: BoolArray) -> tuple[UInt8Array, UInt8Array]:
    """Indices and (256, 4) RGBA colors of an (H, W, 3) picture of few colors; ``empty`` cells are transparent."""
    found, index = np.unique(colors.reshape(-1, 3), axis=0, return_inverse=True)
    ramp = np.zeros((256, 4), np.uint8)
    ramp[1 : len(found) + 1] = np.column_stack([found, np.full(len(found), 255)])
    return np.where(empty, 0, index.reshape(empty.shape) + 1).astype(np.uint8), ramp


def _difference(right: BoolArray, missed: BoolArray, false: BoolArray) -> tuple[UInt8Array, UInt8Array]:
    """Picture of the difference: missed cells over false ones over those that are right."""
    indices, ramp = np.zeros(right.shape, np.uint8), np.zeros((256, 4), np.uint8)
    for index, (cells, color, opacity) in enumerate(
        ((right, RIGHT, _RIGHT_OPACITY), (false, FALSE, 255), (missed, MISSED, 255)), start=1
    ):
        indices[cells] = index
        ramp[index] = *color, opacity
    return indices, ramp


def _svg(indices: AnyArray, ramp: AnyArray) -> str:
    rows, columns = indices.shape
    sheet = Drawing(_SIDE, _SIDE * rows / columns)
    sheet.picture(0, 0, (sheet.width, sheet.height), indices, ramp)
    sheet.mark_ego(sheet.width / 2, sheet.height / 2)
    return sheet.svg()
