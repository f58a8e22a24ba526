"""Predictions as columns, independent of the file format: assigns rows to scenes and frames, and checks values.

From the columns of a Parquet or NPZ file, ``parse_answers`` makes checked ``PredictedBoxes`` and the answered ticks of
one scene.
"""

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from simbev_ros.evaluation.predictions.predicted_boxes import (
    BOX_COLUMNS,
    NO_BOX,
    TRACK_COLUMN,
    VELOCITY_COLUMNS,
    PredictedBoxes,
    Reference,
    Rows,
    predictions_from_columns,
)
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.geometry.ragged import ragged_indices
from simbev_ros.foundation.types import AnyArray, Int64Array, UInt8Array

FRAME_COLUMNS = ("tick", "stamp_ns")
NUMBER_COLUMNS = ("score", *BOX_COLUMNS, *VELOCITY_COLUMNS)
TEXT_COLUMNS = ("scene", "class")
INTEGER_COLUMNS = (*FRAME_COLUMNS, TRACK_COLUMN)
ALL_COLUMNS = (*TEXT_COLUMNS, *INTEGER_COLUMNS, *NUMBER_COLUMNS)


def require_columns(source: str, names: Collection[str]) -> None:
    """Raise InputError if a required column is missing."""
    has = f"it has {', '.join(sorted(names)) or 'none'}"
    for name in ("class", "score", *BOX_COLUMNS):
        if name not in names:
            raise InputError(f"{source}: {name}: there is no such column; {has}")
    if not any(name in names for name in FRAME_COLUMNS):
        raise InputError(f"{source}: tick: there is neither this column nor stamp_ns; {has}")


class SceneRows:
    """Index of the rows of each scene, built for all scenes at once.

    Attributes:
        scenes: Names of the scenes, in order of occurrence.
    """

    def __init__(self, scenes: Sequence[str], code: Int64Array, start: Int64Array, stop: Int64Array) -> None:
        """Take the scenes, and for (R,) runs of rows of one scene its index, first row, and row after the last."""
        order = np.argsort(code, kind="stable")
        self.scenes = tuple(scenes)
        self._scene_index = {scene: index for index, scene in enumerate(scenes)}
        self._first = np.searchsorted(code[order], np.arange(len(scenes) + 1))
        self._code, self._start, self._stop = code[order], start[order], stop[order]

    def max_parts_per_scene(self, starts: Int64Array) -> int:
        """Maximum number of parts, given their first rows, that the rows of one scene spread over; no run spans two."""
        part = np.searchsorted(starts, self._start, side="right") - 1
        pairs = np.unique(self._code * len(starts) + part)
        return int(np.bincount(pairs // len(starts)).max(initial=1))

    @classmethod
    def from_codes(cls, scenes: Sequence[str], code: AnyArray) -> "SceneRows":
        """Index from (N,) scene numbers, one per row."""
        start, stop = runs(code)
        return cls(scenes, code[start].astype(np.int64), start, stop)

    def rows(self, scene: str) -> Int64Array:
        """(N,) row numbers of a scene, ascending."""
        index = self._scene_index[scene]
        chosen = slice(self._first[index], self._first[index + 1])
        start, length = self._start[chosen], self._stop[chosen] - self._start[chosen]
        run, offset = ragged_indices(length)
        return start[run] + offset


def runs(values: AnyArray) -> tuple[Int64Array, Int64Array]:
    """(R,) start index of each run of equal values, and (R,) index after its last value."""
    edges = np.flatnonzero(values[1:] != values[:-1]) + 1
    none = np.zeros(0, np.int64)
    start = np.concatenate([none, [0] if len(values) else none, edges]).astype(np.int64)
    return start, np.append(start[1:], len(values)).astype(np.int64)[: len(start)]


def parse_answers(
    columns: Mapping[str, AnyArray], label: UInt8Array, rows: Rows, frame_id: str, scene: str, stamps_ns: Int64Array
) -> tuple[PredictedBoxes, frozenset[int]]:
    """Check the rows of one scene and convert them to boxes.

    Args:
        columns: (N,) each, of ``INTEGER_COLUMNS`` and ``NUMBER_COLUMNS``.
        label: (N,) labels; ``NO_BOX``: the row only states that its frame was answered.
        rows: Rows of the columns.
        frame_id: Coordinate frame.
        scene: Name of the scene.
        stamps_ns: (T,) stamps of its frames.

    Returns:
        The boxes, and the ticks that were answered.

    Raises:
        InputError: A value is invalid, or there is no such frame.
    """
    tick = _ticks(columns, rows, scene, stamps_ns)
    none = label == NO_BOX
    if none.any():
        score = np.asarray(columns["score"], np.float64)
        rows.require("score", ~none | np.isnan(score), score, "empty, like the class: the row has no box")
        columns = {name: values[~none] for name, values in columns.items()}
        rows = Rows(rows.source, rows.number[~none])
    predictions = predictions_from_columns(columns, label[~none], tick[~none], rows)
    return PredictedBoxes.with_reference(predictions, Reference(frame_id, rows.source)), frozenset(
        np.unique(tick).tolist()
    )


def _ticks(columns: Mapping[str, AnyArray], rows: Rows, scene: str, stamps_ns: Int64Array) -> Int64Array:
    """(N,) ticks from column tick or stamp_ns; if both are given they must agree."""
    count = len(stamps_ns)
    if "stamp_ns" not in columns:
        tick = columns["tick"].astype(np.int64)
        allowed = f"0 to {count - 1}, as {scene} has {count} frames" if count else f"none, as {scene} has no frame"
        rows.require("tick", (tick >= 0) & (tick < count), columns["tick"], allowed)
        return tick
    tick = ticks_of_stamps(columns["stamp_ns"].astype(np.int64), rows, scene, stamps_ns)
    if "tick" in columns:
        rows.require("tick", columns["tick"] == tick, columns["tick"], "that of stamp_ns, or one of them left out")
    return tick


def ticks_of_stamps(stamp_ns: Int64Array, rows: Rows, scene: str, stamps_ns: Int64Array) -> Int64Array:
    """(N,) ticks of (N,) stamps, each of which must equal one of a scene's (T,) stamps.

    Raises:
        InputError: No frame has this stamp; the message names the nearest one.
    """
    if not len(stamps_ns):
        rows.require("stamp_ns", stamp_ns != stamp_ns, stamp_ns, f"none, as {scene} has no frame")
        return stamp_ns
    after = np.searchsorted(stamps_ns, stamp_ns).clip(1 if len(stamps_ns) > 1 else 0, len(stamps_ns) - 1)
    before = np.maximum(after - 1, 0)
    nearest = np.where(stamp_ns - stamps_ns[before] < stamps_ns[after] - stamp_ns, before, after).astype(np.int64)
    good = stamps_ns[nearest] == stamp_ns
    if not good.all():
        tick = int(nearest[np.argmin(good)])
        allowed = f"the stamp of a frame of {scene}; the nearest is {stamps_ns[tick]}, that of tick {tick}"
        rows.require("stamp_ns", good, stamp_ns, allowed)
    return nearest
