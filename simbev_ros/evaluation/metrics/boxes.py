"""Box arrays of ground truth and predictions, the input of all detection metrics; values are checked on entry."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields

import numpy as np

from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.semantics import BOX_CLASSES
from simbev_ros.foundation.types import AnyArray, Float64Array, Int64Array, Table, UInt8Array

NO_ATTRIBUTE = 255
NO_TRACK = -1


@dataclass(frozen=True, slots=True, eq=False)
class Boxes:
    """Upright boxes in the frames of one scene, all in the same coordinate frame.

    Attributes:
        frame: (N,) frame that each box belongs to; any integer, such as a tick or a stamp.
        label: (N,) index into ``BOX_CLASSES``.
        center_m: (N, 3) finite.
        size_m: (N, 3) length, width, height; finite, not negative.
        yaw_rad: (N,) finite. Roll and pitch are ignored.
        velocity_mps: (N, 3); NaN: unknown.
        attribute: (N,) for the nuScenes metrics only: any numbering; ``NO_ATTRIBUTE``: none.
        track: (N,) for the tracking metrics only: id of the object or track in its scene; ``NO_TRACK``: none, as if
            left out.
    """

    frame: Int64Array
    label: UInt8Array
    center_m: Float64Array
    size_m: Float64Array
    yaw_rad: Float64Array
    velocity_mps: Float64Array
    attribute: UInt8Array
    track: Int64Array = field(default_factory=lambda: np.zeros(0, np.int64))

    def __post_init__(self) -> None:
        """Raise InputError for an invalid shape or value."""
        count = len(self.frame)
        if not len(self.track):
            object.__setattr__(self, "track", np.full(count, NO_TRACK, np.int64))
        for name in ("label", "yaw_rad", "attribute", "track"):
            _require_shape(name, getattr(self, name), (count,))
        for name in ("center_m", "size_m", "velocity_mps"):
            _require_shape(name, getattr(self, name), (count, 3))
        for name in ("center_m", "size_m", "yaw_rad"):
            _require(name, np.isfinite(getattr(self, name)), getattr(self, name), "finite")
        _require("size_m", self.size_m >= 0, self.size_m, "not negative")
        _require("velocity_mps", ~np.isinf(self.velocity_mps), self.velocity_mps, "finite, or NaN where unknown")
        _require("label", (self.label >= 0) & (self.label < len(BOX_CLASSES)), self.label, f"below {len(BOX_CLASSES)}")

    def __len__(self) -> int:
        return len(self.frame)

    def take(self, chosen: AnyArray) -> "Boxes":
        """Boxes selected by a mask or by indices."""
        return Boxes(*(getattr(self, each.name)[chosen] for each in fields(self)))


@dataclass(frozen=True, slots=True, eq=False)
class Predictions:
    """Predicted boxes with their confidence.

    Attributes:
        boxes: Boxes in the coordinate frame of the ground truth.
        score: (N,) confidence, higher is more confident; finite.
    """

    boxes: Boxes
    score: Float64Array

    def __post_init__(self) -> None:
        """Raise InputError if a score is missing or not finite."""
        _require_shape("score", self.score, (len(self.boxes),))
        _require("score", np.isfinite(self.score), self.score, "finite")

    def __len__(self) -> int:
        return len(self.boxes)

    def take(self, chosen: AnyArray) -> "Predictions":
        """Predictions selected by a mask or by indices."""
        return Predictions(self.boxes.take(chosen), self.score[chosen])


def boxes_from_tables(tables: Mapping[int, Table]) -> Boxes:
    """Ground-truth boxes from ``schema.boxes.BOX_DTYPE`` tables by frame, in the order of the frames."""
    frame = np.repeat(np.array([*tables], np.int64), np.array([len(table) for table in tables.values()], np.int64))
    parts = [_columns(table) for table in tables.values()]
    if not parts:
        return empty_boxes()
    label, vectors = np.concatenate([table["class"] for table in tables.values()]), np.concatenate(parts)
    attribute = np.full(len(frame), NO_ATTRIBUTE, np.uint8)
    track = np.concatenate([table["id"] for table in tables.values()]).astype(np.int64)
    return Boxes(frame, label, vectors[:, :3], vectors[:, 3:6], vectors[:, 6], vectors[:, 7:], attribute, track)


def empty_boxes() -> Boxes:
    """Boxes without any rows."""
    triples = np.zeros((0, 3))
    return Boxes(
        np.zeros(0, np.int64),
        np.zeros(0, np.uint8),
        triples,
        triples,
        np.zeros(0),
        triples,
        np.zeros(0, np.uint8),
    )


def require_frames(boxes: Boxes, frames: Int64Array, owner: str) -> None:
    """Raise InputError if a box belongs to a frame that is not evaluated, for example of another scene."""
    unknown = np.setdiff1d(boxes.frame, frames)
    if len(unknown):
        known = f"{len(frames)} frames, from {frames.min()} to {frames.max()}" if len(frames) else "no frame"
        raise InputError(f"{owner}: frame: {unknown[0]} is not in this scene, which has {known}")


def _columns(table: Table) -> Float64Array:
    names = ("x", "y", "z", "length", "width", "height", "yaw", "vx", "vy", "vz")
    return np.stack([table[name].astype(np.float64) for name in names], axis=1)


def _require_shape(name: str, values: AnyArray, shape: tuple[int, ...]) -> None:
    if values.shape != shape:
        raise InputError(f"boxes: {name}: has the shape {values.shape}; it must be {shape}")


def _require(name: str, good: AnyArray, values: AnyArray, allowed: str) -> None:
    if not good.all():
        index = np.argwhere(~good)[0]
        raise InputError(f"boxes: {name}: row {index[0]} is {values[tuple(index)]}; it must be {allowed}")
