"""Computes the bird's-eye-view scores: the road, remembered while the ego drives, and the boxes."""

from dataclasses import dataclass

import numpy as np

from simbev_ros.reference_stack.arrays import Bytes, Floats, Integers, Table, box_axes, rotate, yaw_of
from simbev_ros.reference_stack.classes import Kinds
from simbev_ros.reference_stack.ground import Ground, sector_of

CHANNELS: tuple[str, ...] = (
    "road", "hazard", "road_line", "sidewalk", "crosswalk", "traffic_cone", "barrier",
    "car", "truck", "bus", "motorcycle", "bicycle", "rider", "pedestrian",
)  # fmt: skip
"""All classes of /ego/bev/labels in bit order; classes that this stack does not detect stay 0."""

_REACH_M = 40.0
"""Range beyond which a lidar's rings are too far apart to show curbs."""
_BEYOND_CURB_M = 2.0
"""Depth of the strip behind a curb that counts as seen and not road."""
_PRIOR_NOT_ROAD = 1.0
"""Prior number of observations of a cell as not road."""


@dataclass(frozen=True)
class GridShape:
    """The cells of a grid around the ego: row 0 is furthest ahead, column 0 furthest left."""

    rows: int
    columns: int
    cell_m: float

    @property
    def centers_ego(self) -> Floats:
        """(rows, columns, 2) x and y of the cell centers, ego frame."""
        x = ((self.rows - 1) / 2 - np.arange(self.rows)) * self.cell_m
        y = ((self.columns - 1) / 2 - np.arange(self.columns)) * self.cell_m
        return np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)


class RoadMemory:
    """Remembers where road was seen, in cells fixed to the map; cells that the grid has left behind are forgotten."""

    def __init__(self, shape: GridShape) -> None:
        self._cell_m = shape.cell_m
        self._centers_ego = shape.centers_ego.reshape(-1, 2)
        self._shape = shape.rows, shape.columns
        half = int(np.ceil(np.hypot(shape.rows, shape.columns) / 2)) + 2
        self._counts = np.zeros((2, 2 * half, 2 * half), np.float32)  # observations as road, all observations
        self._corner = np.zeros(2, np.int64)
        reach = min(int(_REACH_M / shape.cell_m), half - 1)
        self._near = np.indices((2 * reach + 1, 2 * reach + 1)).reshape(2, -1).T - reach

    def add_ground(self, ground: Ground, map_from_ego: Floats) -> Bytes:
        """Add the ground of one cloud; return (rows, columns) road scores around the ego, 255 = certain.

        Args:
            ground: Ground of the cloud, ego frame.
            map_from_ego: (4, 4) pose of the ego at the cloud's stamp.
        """
        position_m, ego_from_map = map_from_ego[:2, 3], _level_axes(map_from_ego)
        middle = np.floor(position_m / self._cell_m).astype(np.int64)
        self._move(middle - self._counts.shape[1] // 2)
        cell = middle + self._near
        offset_ego = rotate(ego_from_map, (cell + 0.5) * self._cell_m - position_m)
        sector = sector_of(np.arctan2(offset_ego[:, 1], offset_ego[:, 0]))
        beyond_road_m = np.hypot(*offset_ego.T) - ground.road_m[sector]
        is_road = beyond_road_m < 0
        is_seen = is_road | (ground.has_curb[sector] & (beyond_road_m < _BEYOND_CURB_M))
        row, column = (cell - self._corner).T
        self._counts[:, row, column] += np.stack([is_road, is_seen])
        return self._scores(position_m, ego_from_map.T)

    def _move(self, corner: Integers) -> None:
        """Shift the window of cells with the ego; cells that enter it are empty."""
        moved, self._corner = corner - self._corner, corner
        if not moved.any():
            return
        side = self._counts.shape[1]
        moved = np.clip(moved, -side, side)
        self._counts = np.roll(self._counts, -moved, axis=(1, 2))
        for axis, by in enumerate(moved):
            entered = slice(side - by, None) if by > 0 else slice(0, -by)
            self._counts[(slice(None), entered) if axis == 0 else (slice(None), slice(None), entered)] = 0

    def _scores(self, position_m: Floats, map_from_ego: Floats) -> Bytes:
        """(rows, columns) scores of the grid's cells for an ego at a (2,) position with (2, 2) axes."""
        center_m = rotate(map_from_ego, self._centers_ego) + position_m
        row, column = (np.floor(center_m / self._cell_m).astype(np.int64) - self._corner).T
        road, observations = self._counts[:, row, column]
        scores: Bytes = (255 * road / (observations + _PRIOR_NOT_ROAD)).astype(np.uint8).reshape(self._shape)
        return scores


def box_scores(boxes: Table, kinds: Kinds, shape: GridShape, map_from_ego: Floats) -> Bytes:
    """(rows, columns, channels) scores of boxes, map frame; a cell gets the highest score of boxes at its center."""
    scores = np.zeros((shape.rows, shape.columns, len(CHANNELS)), np.uint8)
    centers_ego = shape.centers_ego
    channel = {number: CHANNELS.index(name) for number, name in zip(kinds.class_number, kinds.class_name, strict=True)}
    ego_from_map = _level_axes(map_from_ego)
    position_ego = rotate(ego_from_map, np.stack([boxes["x"], boxes["y"]], axis=1) - map_from_ego[:2, 3])
    axes_ego = box_axes(boxes["yaw"] - yaw_of(map_from_ego))
    half_m = np.stack([boxes["length"], boxes["width"]], axis=1) / 2
    middle = np.array([shape.rows - 1, shape.columns - 1]) / 2 - position_ego / shape.cell_m
    reach = np.hypot(*half_m.T)[:, None] / shape.cell_m
    first = np.maximum(np.ceil(middle - reach), 0).astype(np.int64)
    last = np.maximum(np.floor(middle + reach) + 1, 0).astype(np.int64)
    for number, box in enumerate(boxes):
        rows, columns = (slice(low, high) for low, high in zip(first[number], last[number], strict=True))
        along_m = rotate(axes_ego[number], centers_ego[rows, columns] - position_ego[number])
        covered = (np.abs(along_m) <= half_m[number]).all(axis=-1) * np.uint8(255 * box["score"])
        class_scores = scores[rows, columns, channel[box["class"]]]
        np.maximum(class_scores, covered, out=class_scores)
    return scores


def _level_axes(map_from_ego: Floats) -> Floats:
    """(2, 2) rotation from the map to the ego's heading; the grid stays level when the ego pitches or rolls."""
    return box_axes(np.array(yaw_of(map_from_ego)))
