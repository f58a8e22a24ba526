"""Checked boxes of a perception stack, each in a coordinate frame that the stack chose.

Columns of files or messages are checked and become ``PredictedBoxes``. ``boxes_in_map`` transforms these to the map
frame for the metrics.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np

from simbev_ros.evaluation.metrics.boxes import NO_ATTRIBUTE, NO_TRACK, Boxes, Predictions, empty_boxes
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.semantics import BOX_CLASSES
from simbev_ros.foundation.types import AnyArray, BoolArray, Float64Array, Int64Array, UInt8Array

MAP_FRAME = "map"
NO_BOX = 255
"""Label of a row without a box, which only states that its frame was answered."""
BOX_COLUMNS = ("x", "y", "z", "length", "width", "height", "yaw")
VELOCITY_COLUMNS = ("vx", "vy", "vz")
TRACK_COLUMN = "id"
UPRIGHT = float(np.cos(np.pi / 4))
"""Minimum cosine of the angle between two axes that both count as pointing up."""
CLASSES_ALLOWED = f"one of {', '.join(BOX_CLASSES)}, or its number, 0 to {len(BOX_CLASSES) - 1}"


class Reference(NamedTuple):
    """Coordinate frame, and the file or topic that states it, for error messages."""

    frame_id: str
    source: str


@dataclass(frozen=True, slots=True, eq=False)
class PredictedBoxes:
    """Boxes of a scene, upright in their coordinate frames.

    Attributes:
        predictions: (N,) boxes and scores, each in its own coordinate frame; ``frame`` is the tick.
        references: All coordinate frames.
        reference: (N,) index into ``references``.
    """

    predictions: Predictions
    references: tuple[Reference, ...]
    reference: Int64Array

    def __len__(self) -> int:
        return len(self.predictions)

    def at_ticks(self, ticks: Sequence[int]) -> "PredictedBoxes":
        """Boxes of the given frames."""
        chosen = np.isin(self.predictions.boxes.frame, ticks)
        return PredictedBoxes(self.predictions.take(chosen), self.references, self.reference[chosen])

    @classmethod
    def with_reference(cls, predictions: Predictions, reference: Reference) -> "PredictedBoxes":
        """Boxes that all have the same coordinate frame."""
        return cls(predictions, (reference,), np.zeros(len(predictions), np.int64))


def join_boxes(parts: Sequence[PredictedBoxes]) -> PredictedBoxes:
    """Concatenate the boxes of all parts."""
    own = [part.predictions.boxes for part in parts]
    if not own:
        return PredictedBoxes(Predictions(empty_boxes(), np.zeros(0)), (), np.zeros(0, np.int64))
    boxes = Boxes(*(np.concatenate([getattr(each, field.name) for each in own]) for field in fields(Boxes)))
    number = {
        each: index for index, each in enumerate(dict.fromkeys(each for part in parts for each in part.references))
    }
    indices = [np.array([number[each] for each in part.references], np.int64)[part.reference] for part in parts]
    score = np.concatenate([part.predictions.score for part in parts])
    return PredictedBoxes(Predictions(boxes, score), tuple(number), np.concatenate(indices))


def boxes_in_map(boxes: PredictedBoxes, map_from_frame: Callable[[int, str], Float64Array]) -> Predictions:
    """Transform boxes to the map frame: centers, yaws and velocities; sizes stay.

    Args:
        boxes: Boxes of one scene.
        map_from_frame: Gives the (4, 4) pose of a coordinate frame at a tick; called once for each pair. It raises
            InputError for an unknown coordinate frame. ``reference_frames.ReferenceFrames`` is one such function.

    Raises:
        InputError: A coordinate frame is unknown, or its z axis does not point up, as in optical frames.
    """
    own, count = boxes.predictions.boxes, len(boxes.references)
    if all(each.frame_id == MAP_FRAME for each in boxes.references):
        return boxes.predictions
    pairs, pair = np.unique(own.frame * count + boxes.reference, return_inverse=True)
    poses = np.stack([_pose(boxes.references[key % count], key // count, map_from_frame) for key in pairs.tolist()])[
        pair
    ]
    rotation, cosine, sine = poses[:, :3, :3], np.cos(own.yaw_rad), np.sin(own.yaw_rad)
    ahead = rotation[:, :2, 0] * cosine[:, None] + rotation[:, :2, 1] * sine[:, None]
    transformed = Boxes(
        own.frame,
        own.label,
        np.einsum("nij,nj->ni", rotation, own.center_m) + poses[:, :3, 3],
        own.size_m,
        np.arctan2(ahead[:, 1], ahead[:, 0]),
        np.einsum("nij,nj->ni", rotation, own.velocity_mps),
        own.attribute,
        own.track,
    )
    return Predictions(transformed, boxes.predictions.score)


def _pose(reference: Reference, tick: int, map_from_frame: Callable[[int, str], Float64Array]) -> Float64Array:
    """(4, 4) map from a coordinate frame."""
    frame_id, source = reference
    if frame_id == MAP_FRAME:
        return np.eye(4)
    try:
        pose = map_from_frame(tick, frame_id)
    except InputError as error:
        raise InputError(f"{source}: {error}") from None
    if pose[2, 2] < UPRIGHT:
        raise InputError(
            f"{source}: frame_id: the z axis of {frame_id!r} does not point up, as boxes require; for a camera, use "
            "the frame without _optical"
        )
    return pose


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """Rows of a file or of a message, for error messages.

    Attributes:
        source: File or topic.
        number: (N,) number of each row, from 0.
    """

    source: str
    number: Int64Array

    def require(self, name: str, good: BoolArray, values: AnyArray, allowed: str) -> None:
        """Raise InputError for the first of (N,) values of a column that is not good."""
        if not good.all():
            index = int(np.argmin(good))
            value = values[index].tolist() if hasattr(values[index], "tolist") else values[index]
            raise InputError(f"{self.source}: {name}: row {self.number[index]} is {value!r}; it must be {allowed}")


def numbered_labels(numbers: AnyArray, rows: Rows, *, may_be_empty: bool) -> UInt8Array:
    """(N,) labels from (N,) class numbers.

    Args:
        numbers: Indices into ``BOX_CLASSES``.
        rows: Rows of the numbers.
        may_be_empty: Whether -1 is allowed, which becomes ``NO_BOX``.

    Raises:
        InputError: There is no such class.
    """
    lowest = -1 if may_be_empty else 0
    rows.require("class", (numbers >= lowest) & (numbers < len(BOX_CLASSES)), numbers, CLASSES_ALLOWED)
    return np.where(numbers < 0, NO_BOX, numbers).astype(np.uint8)


def named_labels(names: Sequence[str | None], code: AnyArray, rows: Rows, *, may_be_empty: bool) -> UInt8Array:
    """(N,) labels from class names, or from class numbers as text.

    Args:
        names: Distinct names.
        code: (N,) index into ``names``.
        rows: Rows of the names.
        may_be_empty: Whether "" and None are allowed, which become ``NO_BOX``.

    Raises:
        InputError: There is no such class.
    """
    known: dict[str | None, int] = {name: label for label, name in enumerate(BOX_CLASSES)}
    known |= {None: NO_BOX, "": NO_BOX} if may_be_empty else {}
    known |= {str(label): label for label in range(len(BOX_CLASSES))}
    label = np.array([known.get(name, -1) for name in names], np.int64)[code]
    if (label < 0).any():
        rows.require("class", label >= 0, np.array([*names], object)[code], CLASSES_ALLOWED)
    return label.astype(np.uint8)


def predictions_from_columns(
    columns: Mapping[str, AnyArray], label: UInt8Array, tick: Int64Array, rows: Rows
) -> Predictions:
    """Checked boxes from columns.

    Args:
        columns: (N,) each: ``BOX_COLUMNS``, ``score``, and any of ``VELOCITY_COLUMNS`` and ``TRACK_COLUMN``.
        label: (N,) index into ``BOX_CLASSES``.
        tick: (N,) tick of each box's frame.
        rows: Rows of the columns.

    Raises:
        InputError: A value is not valid for a box.
    """
    own = {name: np.asarray(columns[name], np.float64) for name in ("score", *BOX_COLUMNS)}
    for name, values in own.items():
        rows.require(name, np.isfinite(values), values, "a finite number")
    for name in ("length", "width", "height"):
        rows.require(name, own[name] >= 0, own[name], "at least 0")
    boxes = Boxes(
        tick,
        label,
        np.stack([own[name] for name in ("x", "y", "z")], axis=1),
        np.stack([own[name] for name in ("length", "width", "height")], axis=1),
        own["yaw"],
        _velocity_mps(columns, rows),
        np.full(len(tick), NO_ATTRIBUTE, np.uint8),
        _tracks(columns, tick, rows),
    )
    return Predictions(boxes, own["score"])


def _tracks(columns: Mapping[str, AnyArray], tick: Int64Array, rows: Rows) -> Int64Array:
    """(N,) ids of tracks; ``NO_TRACK`` where they are negative or there is no such column."""
    if TRACK_COLUMN not in columns:
        return np.full(len(tick), NO_TRACK, np.int64)
    track = np.maximum(columns[TRACK_COLUMN].astype(np.int64), NO_TRACK)
    order = np.lexsort((track, tick))
    is_repeated = np.zeros(len(tick), np.bool_)
    is_repeated[order[1:]] = (np.diff(tick[order]) == 0) & (np.diff(track[order]) == 0) & (track[order[1:]] != NO_TRACK)
    rows.require(TRACK_COLUMN, ~is_repeated, track, "different in all boxes of a frame")
    return track


def _velocity_mps(columns: Mapping[str, AnyArray], rows: Rows) -> Float64Array:
    """(N, 3) velocities; NaN if vx or vy is missing or NaN; if only vz is, it is 0."""
    present = [name for name in VELOCITY_COLUMNS if name in columns]
    for name in present:
        values = np.asarray(columns[name], np.float64)
        rows.require(name, ~np.isinf(values), values, "a finite number, or NaN where it is unknown")
    for name, other in (("vx", "vy"), ("vy", "vx"), ("vz", "vx")):
        if name in columns and other not in columns:
            raise InputError(
                f"{rows.source}: {other}: this column is missing, although there is {name}; a velocity needs vx and vy"
            )
    if not present:
        return np.full((len(rows.number), 3), np.nan)
    vx, vy = (np.asarray(columns[name], np.float64) for name in ("vx", "vy"))
    vz = np.nan_to_num(np.asarray(columns["vz"], np.float64)) if "vz" in columns else np.zeros(len(vx))
    velocity_mps = np.stack([vx, vy, vz], axis=1)
    velocity_mps[np.isnan(vx) | np.isnan(vy)] = np.nan
    return velocity_mps
