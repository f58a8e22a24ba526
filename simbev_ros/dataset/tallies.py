"""Counters over frames for the statistics of a dataset: integer sums, so that tallies of batches can be added."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from simbev_ros.dataset import Frame
from simbev_ros.foundation.errors import BagError, foreign_content
from simbev_ros.foundation.semantics import BEV_CLASSES, BOX_CLASSES, DIFFICULTIES
from simbev_ros.foundation.types import AnyArray, Int64Array, Table, UInt16Array
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.schema.boxes import BOX_DTYPE

DISTANCE_STEP_M, DISTANCES = 5.0, 200
SPEED_STEP_MPS, SPEEDS = 1.0, 60
SIZE_STEP_M, SIZES = 0.25, 80
POINT_LEVELS = 20
"""Number of levels of point counts. Level 0: no point; level k: 2^(k - 1) to 2^k - 1 points."""
VISIBILITIES = 20
POSITION_STEP_M, POSITION_BINS = 4.0, 60
"""Side of the square cells around the ego, and their number along each axis; boxes outside are not counted."""
BOXES_PER_FRAME = 512
CELL_M = 4.0
"""Side of the cells of the map in which visits of actors are recorded."""

_CLASSES = len(BOX_CLASSES)
MOMENT_DTYPE = np.dtype(
    [
        ("time_s", "<f8"),  # since the scene's first frame
        ("ego_m", "<f8", (2,)),  # position, map frame; NaN in frames without odometry, as in a bag that ends early
        ("speed_mps", "<f8"),  # of the ego; NaN as well
        ("boxes", "<i8", (_CLASSES,)),  # number of boxes of each class
        ("labeled", "?"),  # whether the frame has boxes
    ]
)
"""One row per frame of a scene."""

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
    "places": (_CLASSES, POSITION_BINS, POSITION_BINS),
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
    """Counts over a set of frames. Values beyond the last bin of a histogram are counted in its last bin.

    Attributes:
        frames: Number of frames.
        counts: int64 arrays by name, with counts of boxes by class (``BOX_CLASSES``) and by the bins above.
            ``visibility`` counts boxes that a camera could see, ``unseen`` the others; ``lidar_boxes`` and
            ``lidar_points`` count boxes whose points were counted; ``places`` has the axes of the bird's-eye view,
            row 0 ahead and column 0 left; ``bev_other`` counts grids of another size than the first, which are in
            no other count.
        bev: (classes, rows, columns) number of frames in which each cell had a class; None: no frame has a grid.
        bev_cell_m: Side of a cell of the grid.
        actors: Number of actors of each blueprint, in the first frame.
        moments: (frames,) ``MOMENT_DTYPE``, in the order of the frames.
        visited: (K, 2) unique indices of cells with side ``CELL_M``, map frame, that actors visited.
    """

    frames: int = 0
    counts: dict[str, Int64Array] = field(
        default_factory=lambda: {name: np.zeros(shape, np.int64) for name, shape in _SHAPES.items()}
    )
    bev: Int64Array | None = None
    bev_cell_m: float = 0.0
    actors: Counter[str] = field(default_factory=Counter)
    moments: Table = field(default_factory=lambda: np.zeros(0, MOMENT_DTYPE))
    visited: Int64Array = field(default_factory=lambda: np.zeros((0, 2), np.int64))

    @classmethod
    def from_frames(cls, frames: Sequence[Frame], *, with_actors: bool) -> "Tally":
        """Tally of some frames of one scene.

        Args:
            frames: The frames.
            with_actors: Whether to count actors by blueprint, in the first frame.

        Raises:
            BagError: The bag is damaged, or its boxes are of another version.
        """
        tally = cls(frames=len(frames), moments=np.zeros(len(frames), MOMENT_DTYPE))
        tally.moments["ego_m"] = tally.moments["speed_mps"] = np.nan
        for index, frame in enumerate(frames):
            moment = tally.moments[index : index + 1]
            moment["time_s"] = (frame.stamp_ns - frame.scene.spec.start_ns) / NS_PER_S
            if "odom" in frame:
                tally._add_ego(frame["odom"][-1], moment)
            if "boxes" in frame:
                moment["boxes"], moment["labeled"] = tally._add_boxes(_boxes(frame)), True
            if "bev/labels" in frame:
                tally._add_grid(frame["bev/labels"], frame.scene.view.annotation.bev.cell_m)
            if "world/actors" in frame:
                tally._add_actors(frame, with_kinds=with_actors and index == 0)
        return tally

    @property
    def labeled_frames(self) -> int:
        """Number of frames with boxes."""
        return int(self.counts["all_per_frame"].sum())

    def add_counts(self, other: "Tally") -> None:
        """Add the counts of other frames, also on another map; ``moments`` and ``visited`` are left unchanged."""
        self.frames += other.frames
        for name, counts in other.counts.items():
            if not name.startswith("bev_"):
                self.counts[name] = self.counts[name] + counts
        self._add_bev(other)
        self.actors += other.actors

    def append_frames(self, other: "Tally") -> None:
        """Add the counts and positions of further frames of the same scene."""
        self.add_counts(other)
        self.moments = np.concatenate([self.moments, other.moments])
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

    def _add_ego(self, row: Table, moment: Table) -> None:
        moment["ego_m"], moment["speed_mps"] = row["position_m"][:2], np.linalg.norm(row["velocity_mps"])
        self._count("ego_speed", _bin(moment["speed_mps"], SPEED_STEP_MPS, SPEEDS))

    def _add_actors(self, frame: Frame, *, with_kinds: bool) -> None:
        actors = frame["world/actors"]
        others = actors[actors["id"] != frame.scene.view.ego_id]
        cells = np.floor(np.stack([others["x"], others["y"]], axis=1) / CELL_M).astype(np.int64)
        self.visited = np.unique(np.concatenate([self.visited, cells]), axis=0)
        if with_kinds:
            legend = frame.scene.constants.get("world/legend")
            if legend is None:
                raise BagError(f"{frame.scene.path}: recorded by another version: it has no /world/legend")
            with foreign_content(f"{frame.scene.path}: /world/legend"):
                names = [str(each["name"]) for each in legend["blueprints"]]
                self.actors.update(names[index] for index in actors["blueprint"].tolist())

    def _add_grid(self, labels: UInt16Array, cell_m: float) -> None:
        masks = labels & (1 << np.arange(len(BEV_CLASSES), dtype=np.uint16))[:, None, None] != 0
        if self.bev is None:
            self.bev, self.bev_cell_m = np.zeros(masks.shape, np.int64), cell_m
        self.bev += masks
        self.counts["bev_present"] += masks.any(axis=(1, 2))
        self.counts["bev_frames"] += 1

    def _add_boxes(self, boxes: Table) -> Int64Array:
        """Count boxes, and return the (classes,) number of each class."""
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
        self._add_positions(boxes)
        self._add_points(boxes, distances)
        return totals

    def _add_points(self, boxes: Table, distances: Int64Array) -> None:
        classes = boxes["class"]
        for kind in ("lidar", "radar"):
            points = boxes[f"{kind}_points"]
            known = points >= 0
            self._count(f"{kind}_boxes", classes[known], distances[known])
            np.add.at(self.counts[f"{kind}_points"], (classes[known], distances[known]), points[known])
            levels = np.frexp(points[known].astype(np.float64))[1]
            self._count(f"{kind}_levels", distances[known], np.minimum(levels, POINT_LEVELS - 1))

    def _add_positions(self, boxes: Table) -> None:
        angle_rad, distance_m = boxes["angle"].astype(np.float64), boxes["distance"].astype(np.float64)
        row = np.floor(POSITION_BINS / 2 - distance_m * np.cos(angle_rad) / POSITION_STEP_M).astype(np.int64)
        column = np.floor(POSITION_BINS / 2 - distance_m * np.sin(angle_rad) / POSITION_STEP_M).astype(np.int64)
        near = (row >= 0) & (row < POSITION_BINS) & (column >= 0) & (column < POSITION_BINS)
        self._count("places", boxes["class"][near], row[near], column[near])

    def _count(self, name: str, *bins: AnyArray) -> None:
        """Add 1 to each of (N,) bins, given by their index along each axis."""
        np.add.at(self.counts[name], bins if len(bins) > 1 else bins[0], 1)


def _bin(values: AnyArray, step: float, count: int) -> Int64Array:
    """(N,) bin indices of (N,) values; values beyond the last bin are put into it."""
    return np.clip(np.floor(np.asarray(values, np.float64) / step), 0, count - 1).astype(np.int64)


def _boxes(frame: Frame) -> Table:
    """The boxes of a frame; raises BagError if the table lacks a column."""
    boxes: Table = frame["boxes"]
    missing = sorted(set(BOX_DTYPE.names or ()) - set(boxes.dtype.names or ()))
    if missing:
        raise BagError(f"{frame.scene.path}: recorded by another version: its boxes have no {', '.join(missing)}")
    return boxes
