"""Predictions in columns, whatever file they are from: which rows are of which scene, and what rows say."""

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from simbev_ros.errors import InputError
from simbev_ros.evaluation.predictions.predicted_boxes import (
    BOX_COLUMNS,
    NO_BOX,
    VELOCITY_COLUMNS,
    PredictedBoxes,
    Reference,
    Rows,
    predictions_of,
)
from simbev_ros.types import AnyArray, Int64Array, UInt8Array

FRAME_COLUMNS = ("tick", "stamp_ns")
NUMBER_COLUMNS = ("score", *BOX_COLUMNS, *VELOCITY_COLUMNS)
TEXT_COLUMNS = ("scene", "class")
ALL_COLUMNS = (*TEXT_COLUMNS, *FRAME_COLUMNS, *NUMBER_COLUMNS)


def require_columns(source: str, names: Collection[str]) -> None:
    """Raise InputError if a column is missing without which there are no predictions."""
    has = f"it has {', '.join(sorted(names)) or 'none'}"
    for name in ("class", "score", *BOX_COLUMNS):
        if name not in names:
            raise InputError(f"{source}: {name}: there is no such column; {has}")
    if not any(name in names for name in FRAME_COLUMNS):
        raise InputError(f"{source}: tick: there is neither this column nor stamp_ns; {has}")


class SceneRows:
    """Which rows are of which scene, found at once for all scenes.

    Attributes:
        scenes: In the order in which they occur.
    """

    def __init__(self, scenes: Sequence[str], code: Int64Array, start: Int64Array, stop: Int64Array) -> None:
        """Takes scenes, and of (R,) runs of rows of one scene its index, the first row, and that after the last."""
        order = np.argsort(code, kind="stable")
        self.scenes = tuple(scenes)
        self._place = {scene: place for place, scene in enumerate(scenes)}
        self._first = np.searchsorted(code[order], np.arange(len(scenes) + 1))
        self._code, self._start, self._stop = code[order], start[order], stop[order]

    def most_parts(self, starts: Int64Array) -> int:
        """Into how many of the parts that begin at some rows the rows of one scene fall at most; runs fall into one."""
        part = np.searchsorted(starts, self._start, side="right") - 1
        pairs = np.unique(self._code * len(starts) + part)
        return int(np.bincount(pairs // len(starts)).max(initial=1))

    @classmethod
    def of_codes(cls, scenes: Sequence[str], code: AnyArray) -> "SceneRows":
        """Of (N,) indices into the scenes, one a row."""
        start, stop = runs(code)
        return cls(scenes, code[start].astype(np.int64), start, stop)

    def rows(self, scene: str) -> Int64Array:
        """(N,) those of a scene, ascending."""
        place = self._place[scene]
        chosen = slice(self._first[place], self._first[place + 1])
        start, length = self._start[chosen], self._stop[chosen] - self._start[chosen]
        before = np.cumsum(length) - length
        return np.repeat(start - before, length) + np.arange(length.sum())


def runs(values: AnyArray) -> tuple[Int64Array, Int64Array]:
    """(R,) first place of each run of equal values, and the place after its last."""
    edges = np.flatnonzero(values[1:] != values[:-1]) + 1
    none = np.zeros(0, np.int64)
    start = np.concatenate([none, [0] if len(values) else none, edges]).astype(np.int64)
    return start, np.append(start[1:], len(values)).astype(np.int64)[: len(start)]


def answers_of(
    columns: Mapping[str, AnyArray], label: UInt8Array, rows: Rows, frame_id: str, scene: str, stamps_ns: Int64Array
) -> tuple[PredictedBoxes, frozenset[int]]:
    """What some rows say.

    Args:
        columns: (N,) each, of ``FRAME_COLUMNS`` and ``NUMBER_COLUMNS``.
        label: (N,) their classes; ``NO_BOX``: the row says only that its frame was answered.
        rows: Whose these are.
        frame_id: Frame of reference.
        scene: Whose boxes these are.
        stamps_ns: (T,) of its frames.

    Returns:
        The boxes, and the ticks that were answered.

    Raises:
        InputError: A value is none that it can have, or there is no such frame.
    """
    tick = _ticks(columns, rows, scene, stamps_ns)
    none = label == NO_BOX
    if none.any():
        score = np.asarray(columns["score"], np.float64)
        rows.require("score", ~none | np.isnan(score), score, "empty as well, as the class is: the row has no box")
        columns = {name: values[~none] for name, values in columns.items()}
        rows = Rows(rows.source, rows.number[~none])
    predictions = predictions_of(columns, label[~none], tick[~none], rows)
    return PredictedBoxes.of(predictions, Reference(frame_id, rows.source)), frozenset(np.unique(tick).tolist())


def _ticks(columns: Mapping[str, AnyArray], rows: Rows, scene: str, stamps_ns: Int64Array) -> Int64Array:
    """(N,) by tick or stamp; where both are given they must agree."""
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
    """(N,) ticks of (N,) stamps, which must be those of a scene's (T,) frames exactly.

    Raises:
        InputError: A stamp is that of no frame; names the nearest one.
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
