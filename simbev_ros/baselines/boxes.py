"""The boxes that baselines predict, and how heat maps and values at their peaks become boxes."""

from collections.abc import Sequence

import numpy as np

from simbev_ros.baselines.grid import HALF_M, level_from_map
from simbev_ros.foundation.semantics import BOX_CLASSES
from simbev_ros.foundation.types import AnyArray, Float32Array, Float64Array, Table

DETECTED_CLASSES = BOX_CLASSES[:6]
"""Classes of boxes that are predicted: those of the paper, for which the weights of this package were trained."""
LARGE_CLASSES = 3
"""The first of them: their centers are predicted on the cells of features, those of the others on the finer grid."""
BOX_VALUES = ("dx", "dy", "z", "log_length", "log_width", "log_height", "sin_yaw", "cos_yaw", "vx", "vy")
"""Values of a box at the cell of its center: offset from the cell's center along rows and columns, in cells; height, m;
logarithms of its size in m; heading and velocity in the level frame, m/s."""
BOX_DTYPE = np.dtype(
    [
        ("x", "<f8"),  # m, level frame: center of the box
        ("y", "<f8"),
        ("z", "<f8"),
        ("length", "<f4"),  # m
        ("width", "<f4"),
        ("height", "<f4"),
        ("yaw", "<f4"),  # rad, level frame
        ("vx", "<f4"),  # m/s over ground, level frame
        ("vy", "<f4"),
        ("score", "<f4"),  # 0 … 1
        ("class", "u1"),  # index into BOX_CLASSES
    ]
)
_MAX_BOXES = 400
_MIN_SCORE = 0.02
_APART_WIDTHS = 0.8
"""Minimum distance of two boxes of a class over the width of the more certain one."""


def decode_boxes(peaks: Sequence[tuple[Float32Array, Float32Array]]) -> Table:
    """Boxes of one frame, by descending score.

    Args:
        peaks: Scores (classes, cells, cells), 0 where a neighbor has a higher one, and values of boxes
            (len(BOX_VALUES), cells, cells), of one part of DETECTED_CLASSES after the other; each part has cells of
            its own.
    """
    firsts = np.cumsum([0] + [len(heat) for heat, _ in peaks])
    parts = [_boxes_at(heat, values, int(first)) for first, (heat, values) in zip(firsts, peaks, strict=False)]
    boxes = np.concatenate(parts)
    boxes = boxes[np.argsort(-boxes["score"], kind="stable")][:_MAX_BOXES]
    return boxes[_apart(boxes)]


def _boxes_at(heat: Float32Array, values: Float32Array, first_label: int) -> Table:
    """Boxes at the likely cells of classes that begin with a label."""
    cells, cell_m = heat.shape[1], 2 * HALF_M / heat.shape[1]
    flat = heat.ravel()
    likely = np.flatnonzero(flat > _MIN_SCORE)
    likely = likely[np.argsort(-flat[likely], kind="stable")][:_MAX_BOXES]
    label, row, column = np.unravel_index(likely, (len(heat), cells, cells))
    dx, dy, z, length, width, height, sine, cosine, vx, vy = values[:, row, column]
    boxes = np.zeros(len(likely), BOX_DTYPE)
    boxes["x"] = HALF_M - (row + 0.5 + dx) * cell_m
    boxes["y"] = HALF_M - (column + 0.5 + dy) * cell_m
    boxes["z"], boxes["yaw"] = z, np.arctan2(sine, cosine)
    for name, logarithm in (("length", length), ("width", width), ("height", height)):
        boxes[name] = np.exp(np.clip(logarithm, -3.0, 4.0))
    boxes["vx"], boxes["vy"], boxes["score"], boxes["class"] = vx, vy, flat[likely], label + first_label
    return boxes


def boxes_in_map(boxes: Table, map_from_ego: Float64Array) -> Table:
    """Boxes of the level frame in the map frame."""
    map_from_level = np.linalg.inv(level_from_map(map_from_ego))
    result = boxes.copy()
    center = np.stack([boxes["x"], boxes["y"], boxes["z"]], 1) @ map_from_level[:3, :3].T + map_from_level[:3, 3]
    result["x"], result["y"], result["z"] = center.T
    result["vx"], result["vy"] = map_from_level[:2, :2] @ np.stack([boxes["vx"], boxes["vy"]])
    heading_rad = np.arctan2(map_from_level[1, 0], map_from_level[0, 0])
    result["yaw"] = np.angle(np.exp(1j * (boxes["yaw"] + heading_rad)))
    return result


def _apart(boxes: Table) -> AnyArray:
    """(N,) whether no more certain box of the same class is too near; boxes by descending score."""
    distance_m = np.hypot(boxes["x"][:, None] - boxes["x"], boxes["y"][:, None] - boxes["y"])
    near = (distance_m < _APART_WIDTHS * boxes["width"][:, None]) & (boxes["class"][:, None] == boxes["class"])
    kept = np.ones(len(boxes), np.bool_)
    for index in range(len(boxes)):
        if kept[index]:
            kept[index + 1 :] &= ~near[index, index + 1 :]
    return kept
