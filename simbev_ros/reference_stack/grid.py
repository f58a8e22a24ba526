"""The bird's-eye-view grid: the road, remembered while the ego drives, and the boxes."""

from dataclasses import dataclass

import numpy as np

from simbev_ros.reference_stack.arrays import Bytes, Floats, Integers, Table, box_axes, turned, yaw_of
from simbev_ros.reference_stack.classes import Kinds
from simbev_ros.reference_stack.ground import Ground, sector_of

CHANNELS: tuple[str, ...] = (
    "road", "hazard", "road_line", "sidewalk", "crosswalk", "traffic_cone", "barrier",
    "car", "truck", "bus", "motorcycle", "bicycle", "rider", "pedestrian",
)  # fmt: skip
"""All classes of /ego/bev/labels in bit order. What this stack cannot tell stays 0."""

_REACH_M = 40.0
"""Rings farther away are too far apart to show kerbs."""
_BEYOND_KERB_M = 2.0
_DOUBT = 1.0
"""Looks at a cell in which it was no road, before the first."""


@dataclass(frozen=True)
class GridShape:
    """Cells around the ego: row 0 furthest ahead, column 0 furthest left."""

    rows: int
    columns: int
    cell_m: float

    @property
    def centers_ego(self) -> Floats:
        """(rows, columns, 2) x and y of the cells' centres, ego frame."""
        x = ((self.rows - 1) / 2 - np.arange(self.rows)) * self.cell_m
        y = ((self.columns - 1) / 2 - np.arange(self.columns)) * self.cell_m
        return np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)


class RoadMemory:
    """Where road was seen, in cells that lie still in the map; what the grid has left behind is forgotten."""

    def __init__(self, shape: GridShape) -> None:
        self._cell_m = shape.cell_m
        self._centers_ego = shape.centers_ego.reshape(-1, 2)
        self._shape = shape.rows, shape.columns
        half = int(np.ceil(np.hypot(shape.rows, shape.columns) / 2)) + 2
        self._counts = np.zeros((2, 2 * half, 2 * half), np.float32)  # looks that saw road, all looks
        self._corner = np.zeros(2, np.int64)
        reach = min(int(_REACH_M / shape.cell_m), half - 1)
        self._near = np.indices((2 * reach + 1, 2 * reach + 1)).reshape(2, -1).T - reach

    def look(self, ground: Ground, map_from_ego: Floats) -> Bytes:
        """Remember what one cloud shows; give (rows, columns) scores of the road around the ego, 255 sure."""
        place_m, ego_from_map = map_from_ego[:2, 3], _level_axes(map_from_ego)
        middle = np.floor(place_m / self._cell_m).astype(np.int64)
        self._move(middle - self._counts.shape[1] // 2)
        cell = middle + self._near
        offset_ego = turned(ego_from_map, (cell + 0.5) * self._cell_m - place_m)
        sector = sector_of(np.arctan2(offset_ego[:, 1], offset_ego[:, 0]))
        beyond_m = np.hypot(*offset_ego.T) - ground.road_m[sector]
        is_road = beyond_m < 0
        is_seen = is_road | (ground.has_kerb[sector] & (beyond_m < _BEYOND_KERB_M))
        row, column = (cell - self._corner).T
        self._counts[:, row, column] += np.stack([is_road, is_seen])
        return self._scores(place_m, ego_from_map.T)

    def _move(self, corner: Integers) -> None:
        """Let the cells follow the ego."""
        moved, self._corner = corner - self._corner, corner
        if not moved.any():
            return
        side = self._counts.shape[1]
        moved = np.clip(moved, -side, side)
        self._counts = np.roll(self._counts, -moved, axis=(1, 2))
        for axis, by in enumerate(moved):
            came = slice(side - by, None) if by > 0 else slice(0, -by)
            self._counts[(slice(None), came) if axis == 0 else (slice(None), slice(None), came)] = 0

    def _scores(self, place_m: Floats, map_from_ego: Floats) -> Bytes:
        """Of the cells of an ego at (2,) with (2, 2) axes."""
        center_m = turned(map_from_ego, self._centers_ego) + place_m
        row, column = (np.floor(center_m / self._cell_m).astype(np.int64) - self._corner).T
        road, looks = self._counts[:, row, column]
        scores: Bytes = (255 * road / (looks + _DOUBT)).astype(np.uint8).reshape(self._shape)
        return scores


def box_scores(boxes: Table, kinds: Kinds, shape: GridShape, map_from_ego: Floats) -> Bytes:
    """(rows, columns, channels) scores of boxes, map frame: a cell has that of the surest box over its centre."""
    scores = np.zeros((shape.rows, shape.columns, len(CHANNELS)), np.uint8)
    centers_ego = shape.centers_ego
    channel = {number: CHANNELS.index(name) for number, name in zip(kinds.class_number, kinds.class_name, strict=True)}
    ego_from_map = _level_axes(map_from_ego)
    place_ego = turned(ego_from_map, np.stack([boxes["x"], boxes["y"]], axis=1) - map_from_ego[:2, 3])
    axes_ego = box_axes(boxes["yaw"] - yaw_of(map_from_ego))
    half_m = np.stack([boxes["length"], boxes["width"]], axis=1) / 2
    middle = np.array([shape.rows - 1, shape.columns - 1]) / 2 - place_ego / shape.cell_m
    reach = np.hypot(*half_m.T)[:, None] / shape.cell_m
    first = np.maximum(np.ceil(middle - reach), 0).astype(np.int64)
    last = np.maximum(np.floor(middle + reach) + 1, 0).astype(np.int64)
    for number, box in enumerate(boxes):
        rows, columns = (slice(low, high) for low, high in zip(first[number], last[number], strict=True))
        along_m = turned(axes_ego[number], centers_ego[rows, columns] - place_ego[number])
        covered = (np.abs(along_m) <= half_m[number]).all(axis=-1) * np.uint8(255 * box["score"])
        of_class = scores[rows, columns, channel[box["class"]]]
        np.maximum(of_class, covered, out=of_class)
    return scores


def _level_axes(map_from_ego: Floats) -> Floats:
    """(2, 2) rotation from the map to the ego's heading: the grid stays level when the ego does not."""
    return box_axes(np.array(yaw_of(map_from_ego)))
