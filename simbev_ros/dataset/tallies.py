"""What is counted of frames for the statistics of a dataset: sums of whole numbers, so that parts can be added."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from simbev_ros.annotation.boxes.boxes import BOX_DTYPE
from simbev_ros.dataset import Frame
from simbev_ros.errors import BagError
from simbev_ros.scene.state import EGO_ID
from simbev_ros.semantics import BEV_CLASSES, BOX_CLASSES, DIFFICULTIES
from simbev_ros.types import AnyArray, Float64Array, Int64Array, Table, UInt16Array

DISTANCE_STEP_M, DISTANCES = 5.0, 200
SPEED_STEP_MPS, SPEEDS = 1.0, 60
SIZE_STEP_M, SIZES = 0.25, 80
POINT_LEVELS = 20
"""Level 0: no point, level k: from 2^(k - 1) up to 2^k - 1."""
VISIBILITIES = 20
PLACE_STEP_M, PLACES = 4.0, 60
"""Cells around the ego; what is farther is not in them."""
BOXES_PER_FRAME = 512
CELL_M = 4.0
"""Of the raster that says where actors were."""

_CLASSES = len(BOX_CLASSES)
_SHAPES: dict[str, tuple[int, ...]] = {
    "boxes": (_CLASSES,),
    "valid": (_CLASSES,),
    "unseen": (_CLASSES,),
    "per_frame": (_CLASSES, BOXES_PER_FRAME),
    "all_per_frame": (BOXES_PER_FRAME,),
    "difficulty": (_CLASSES, len(DIFFICULTIES)),
    "distance": (_CLASSES, DISTANCES),
    "speed": (_CLASSES, SPEEDS),
    "size": (3, _CLASSES, SIZES),
    "visibility": (_CLASSES, VISIBILITIES),
    "places": (_CLASSES, PLACES, PLACES),
    **{f"{kind}_boxes": (_CLASSES, DISTANCES) for kind in ("lidar", "radar")},
    **{f"{kind}_points": (_CLASSES, DISTANCES) for kind in ("lidar", "radar")},
    **{f"{kind}_levels": (DISTANCES, POINT_LEVELS) for kind in ("lidar", "radar")},
    "ego_speed": (SPEEDS,),
    "bev_frames": (),
    "bev_present": (len(BEV_CLASSES),),
    "bev_other": (),
}


@dataclass(eq=False)
class Tally:
    """Counts of some frames. Where a last bin is passed, the last bin counts.

    Attributes:
        frames: How many there were.
        counts: By name, int64: of boxes by class (``BOX_CLASSES``) and of the bins above. ``visibility`` is of
            boxes that a camera could see, ``unseen`` the others; ``lidar_boxes`` and ``lidar_points`` are of boxes
            whose points were counted; ``places`` has rows ahead and columns to the left as the bird's-eye view;
            ``bev_other`` counts grids of another size than the first, which are in no other count.
        bev: (classes, rows, columns) in how many frames each cell had a class; None: no grid was seen.
        bev_cell_m: Side of a cell.
        actors: How many there were of each blueprint, in the first frame.
        ego_m: (frames, 2) where the ego was, map frame; of frames without odometry, as of a bag that ends early, none.
        visited: (K, 2) cells of ``CELL_M`` of the map in which actors were, each once.
    """

    frames: int = 0
    counts: dict[str, Int64Array] = field(
        default_factory=lambda: {name: np.zeros(shape, np.int64) for name, shape in _SHAPES.items()}
    )
    bev: Int64Array | None = None
    bev_cell_m: float = 0.0
    actors: Counter[str] = field(default_factory=Counter)
    ego_m: Float64Array = field(default_factory=lambda: np.zeros((0, 2)))
    visited: Int64Array = field(default_factory=lambda: np.zeros((0, 2), np.int64))

    @classmethod
    def of(cls, frames: Sequence[Frame], *, with_actors: bool) -> "Tally":
        """That of some frames of one scene; kinds of actors are counted in the first one if they are wanted.

        Raises:
            BagError: The bag is damaged, or its boxes are of another version.
        """
        tally = cls(frames=len(frames))
        for index, frame in enumerate(frames):
            if "odom" in frame:
                tally._add_ego(frame["odom"][-1])
            if "boxes" in frame:
                tally._add_boxes(_boxes(frame))
            if "bev/labels" in frame:
                tally._add_grid(frame["bev/labels"], frame.scene.spec.annotation.bev.cell_m)
            if "world/actors" in frame:
                tally._add_actors(frame, with_kinds=with_actors and index == 0)
        return tally

    def add(self, other: "Tally") -> None:
        """Add the counts of other frames; where they are of another map, ``ego_m`` and ``visited`` mean nothing."""
        self.frames += other.frames
        for name, counts in other.counts.items():
            if not name.startswith("bev_"):
                self.counts[name] = self.counts[name] + counts
        self._add_bev(other)
        self.actors += other.actors

    def join(self, other: "Tally") -> None:
        """Add the counts of further frames of the same scene, and where they were."""
        self.add(other)
        self.ego_m = np.concatenate([self.ego_m, other.ego_m])
        self.visited = np.unique(np.concatenate([self.visited, other.visited]), axis=0)

    def _add_bev(self, other: "Tally") -> None:
        if other.bev is None:
            return
        if self.bev is None:
            self.bev, self.bev_cell_m = np.zeros_like(other.bev), other.bev_cell_m
        if (self.bev.shape, self.bev_cell_m) != (other.bev.shape, other.bev_cell_m):
            self.counts["bev_other"] = self.counts["bev_other"] + other.counts["bev_frames"] + other.counts["bev_other"]
            return
        self.bev += other.bev
        for name in ("bev_frames", "bev_present", "bev_other"):
            self.counts[name] = self.counts[name] + other.counts[name]

    def _add_ego(self, row: Table) -> None:
        self.ego_m = np.append(self.ego_m, row["position_m"][None, :2], axis=0)
        self._count("ego_speed", _bin(np.linalg.norm(row["velocity_mps"][None], axis=1), SPEED_STEP_MPS, SPEEDS))

    def _add_actors(self, frame: Frame, *, with_kinds: bool) -> None:
        actors = frame["world/actors"]
        others = actors[actors["id"] != EGO_ID]
        cells = np.floor(np.stack([others["x"], others["y"]], axis=1) / CELL_M).astype(np.int64)
        self.visited = np.unique(np.concatenate([self.visited, cells]), axis=0)
        if with_kinds:
            legend = frame.scene.constants.get("world/legend")
            if legend is None:
                raise BagError(f"{frame.scene.path}: recorded by another version: it has no /world/legend")
            blueprints = legend["blueprints"]
            self.actors.update(blueprints[index]["name"] for index in actors["blueprint"].tolist())

    def _add_grid(self, labels: UInt16Array, cell_m: float) -> None:
        masks = labels & (1 << np.arange(len(BEV_CLASSES), dtype=np.uint16))[:, None, None] != 0
        if self.bev is None:
            self.bev, self.bev_cell_m = np.zeros(masks.shape, np.int64), cell_m
        self.bev += masks
        self.counts["bev_present"] += masks.any(axis=(1, 2))
        self.counts["bev_frames"] += 1

    def _add_boxes(self, boxes: Table) -> None:
        classes = boxes["class"]
        distances = _bin(boxes["distance"], DISTANCE_STEP_M, DISTANCES)
        totals = np.bincount(classes, minlength=_CLASSES)
        self.counts["boxes"] += totals
        self._count("per_frame", np.arange(_CLASSES), _bin(totals, 1, BOXES_PER_FRAME))
        self._count("all_per_frame", _bin(np.array([len(boxes)]), 1, BOXES_PER_FRAME))
        self._count("valid", classes[boxes["valid"] > 0])
        self._count("difficulty", classes, boxes["difficulty"])
        self._count("distance", classes, distances)
        speeds = np.linalg.norm(np.stack([boxes[name] for name in ("vx", "vy", "vz")]), axis=0)
        self._count("speed", classes, _bin(speeds, SPEED_STEP_MPS, SPEEDS))
        for axis, name in enumerate(("length", "width", "height")):
            self._count("size", np.full(len(boxes), axis), classes, _bin(boxes[name], SIZE_STEP_M, SIZES))
        seen = np.isfinite(boxes["visibility"])
        self._count("unseen", classes[~seen])
        self._count("visibility", classes[seen], _bin(boxes["visibility"][seen], 1 / VISIBILITIES, VISIBILITIES))
        self._add_places(boxes)
        for kind in ("lidar", "radar"):
            points = boxes[f"{kind}_points"]
            known = points >= 0
            self._count(f"{kind}_boxes", classes[known], distances[known])
            np.add.at(self.counts[f"{kind}_points"], (classes[known], distances[known]), points[known])
            levels = np.frexp(points[known].astype(np.float64))[1]
            self._count(f"{kind}_levels", distances[known], np.minimum(levels, POINT_LEVELS - 1))

    def _add_places(self, boxes: Table) -> None:
        angle_rad, distance_m = boxes["angle"].astype(np.float64), boxes["distance"].astype(np.float64)
        row = np.floor(PLACES / 2 - distance_m * np.cos(angle_rad) / PLACE_STEP_M).astype(np.int64)
        column = np.floor(PLACES / 2 - distance_m * np.sin(angle_rad) / PLACE_STEP_M).astype(np.int64)
        near = (row >= 0) & (row < PLACES) & (column >= 0) & (column < PLACES)
        self._count("places", boxes["class"][near], row[near], column[near])

    def _count(self, name: str, *bins: AnyArray) -> None:
        """Count one more in each of (N,) bins, given by their index along each axis."""
        np.add.at(self.counts[name], bins if len(bins) > 1 else bins[0], 1)


def _bin(values: AnyArray, step: float, count: int) -> Int64Array:
    """(N,) index of the bin of each of (N,) values, the last one for what is beyond."""
    return np.clip(np.floor(np.asarray(values, np.float64) / step), 0, count - 1).astype(np.int64)


def _boxes(frame: Frame) -> Table:
    """The boxes of a frame; refuses tables that lack a column."""
    boxes: Table = frame["boxes"]
    missing = sorted(set(BOX_DTYPE.names or ()) - set(boxes.dtype.names or ()))
    if missing:
        raise BagError(f"{frame.scene.path}: recorded by another version: its boxes have no {', '.join(missing)}")
    return boxes
