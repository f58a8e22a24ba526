"""Boxes as the metrics take them: columns of numbers, of the truth and of predictions, checked once on entry."""

from collections.abc import Mapping
from dataclasses import dataclass, fields

import numpy as np

from simbev_ros.errors import InputError
from simbev_ros.semantics import BOX_CLASSES
from simbev_ros.types import AnyArray, Float64Array, Int64Array, Table, UInt8Array

NO_ATTRIBUTE = 255


@dataclass(frozen=True, slots=True, eq=False)
class Boxes:
    """Upright boxes of the frames of one scene, all in one frame of reference.

    Attributes:
        frame: (N,) which frame each belongs to; any whole number, such as a tick or a stamp.
        label: (N,) index into ``BOX_CLASSES``.
        center_m: (N, 3) finite.
        size_m: (N, 3) length, width, height; finite, not negative.
        yaw_rad: (N,) finite. Roll and pitch do not count.
        velocity_mps: (N, 3); NaN: unknown.
        attribute: (N,) of nuScenes' metric only: any numbering, ``NO_ATTRIBUTE``: none.
    """

    frame: Int64Array
    label: UInt8Array
    center_m: Float64Array
    size_m: Float64Array
    yaw_rad: Float64Array
    velocity_mps: Float64Array
    attribute: UInt8Array

    def __post_init__(self) -> None:
        """Raise InputError for a shape or a value that no box can have."""
        count = len(self.frame)
        for name in ("label", "yaw_rad", "attribute"):
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
        """Those of a mask or of indices."""
        return Boxes(*(getattr(self, each.name)[chosen] for each in fields(self)))


@dataclass(frozen=True, slots=True, eq=False)
class Predictions:
    """Boxes with a confidence.

    Attributes:
        boxes: In the truth's frame of reference.
        score: (N,) higher is surer; finite.
    """

    boxes: Boxes
    score: Float64Array

    def __post_init__(self) -> None:
        """Raise InputError where a score is missing or not finite."""
        _require_shape("score", self.score, (len(self.boxes),))
        _require("score", np.isfinite(self.score), self.score, "finite")

    def __len__(self) -> int:
        return len(self.boxes)

    def take(self, chosen: AnyArray) -> "Predictions":
        """Those of a mask or of indices."""
        return Predictions(self.boxes.take(chosen), self.score[chosen])


def boxes_of(tables: Mapping[int, Table]) -> Boxes:
    """The truth: ``annotation.boxes.BOX_DTYPE`` tables by frame, frames in the order given."""
    frame = np.repeat(np.array([*tables], np.int64), np.array([len(table) for table in tables.values()], np.int64))
    parts = [_columns(table) for table in tables.values()]
    if not parts:
        return no_boxes()
    label, vectors = np.concatenate([table["class"] for table in tables.values()]), np.concatenate(parts)
    attribute = np.full(len(frame), NO_ATTRIBUTE, np.uint8)
    return Boxes(frame, label, vectors[:, :3], vectors[:, 3:6], vectors[:, 6], vectors[:, 7:], attribute)


def no_boxes() -> Boxes:
    """None at all."""
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


def require_frames(boxes: Boxes, frames: Int64Array, what: str) -> None:
    """Raise InputError if a box belongs to a frame that is not among those evaluated, as of a wrong scene."""
    strange = np.setdiff1d(boxes.frame, frames)
    if len(strange):
        known = f"{len(frames)} frames, from {frames.min()} to {frames.max()}" if len(frames) else "no frame"
        raise InputError(f"{what}: frame: {strange[0]} is not of this scene, which has {known}")


def _columns(table: Table) -> Float64Array:
    names = ("x", "y", "z", "length", "width", "height", "yaw", "vx", "vy", "vz")
    return np.stack([table[name].astype(np.float64) for name in names], axis=1)


def _require_shape(name: str, values: AnyArray, shape: tuple[int, ...]) -> None:
    if values.shape != shape:
        raise InputError(f"boxes: {name}: has the shape {values.shape}; it must be {shape}")


def _require(name: str, good: AnyArray, values: AnyArray, allowed: str) -> None:
    if not good.all():
        place = np.argwhere(~good)[0]
        raise InputError(f"boxes: {name}: row {place[0]} is {values[tuple(place)]}; it must be {allowed}")
