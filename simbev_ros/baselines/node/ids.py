"""Names boxes over time: a box near where one of the same class must be by now has its id."""

import numpy as np

from simbev_ros.foundation.types import AnyArray, Table

_GATE_M = 2.0
"""Maximum distance of a box from where its velocity has brought it."""
_MEMORY_S = 1.0
"""Time for which an object that is not found keeps its id."""
_KNOWN_DTYPE = np.dtype(
    [("x", "f8"), ("y", "f8"), ("vx", "f8"), ("vy", "f8"), ("class", "u1"), ("id", "u4"), ("seen_s", "f8")]
)


class BoxIds:
    """Ids of the boxes of one frame after another; the nearest pairs are joined first."""

    def __init__(self) -> None:
        self._known = np.zeros(0, _KNOWN_DTYPE)
        self._next_id = 1

    def assign(self, boxes: Table, stamp_s: float) -> AnyArray:
        """Ids (N,) uint32, from 1, of the boxes of a frame.

        Args:
            boxes: (N,) ``boxes.BOX_DTYPE``, map frame.
            stamp_s: Stamp of the frame; when it is earlier than the last one, all ids are new.
        """
        age_s = stamp_s - self._known["seen_s"]
        known = self._known[(age_s > 0) & (age_s < _MEMORY_S)]
        age_s = stamp_s - known["seen_s"]
        x, y = known["x"] + known["vx"] * age_s, known["y"] + known["vy"] * age_s
        distance_m = np.hypot(x[:, None] - boxes["x"], y[:, None] - boxes["y"])
        distance_m[known["class"][:, None] != boxes["class"]] = np.inf
        old, new = _nearest_pairs(distance_m)
        ids = np.zeros(len(boxes), np.uint32)
        ids[new] = known["id"][old]
        fresh = np.flatnonzero(ids == 0)
        ids[fresh] = self._next_id + np.arange(len(fresh))
        self._next_id += len(fresh)
        found = np.zeros(len(boxes), _KNOWN_DTYPE)
        for name in ("x", "y", "vx", "vy", "class"):
            found[name] = boxes[name]
        found["id"], found["seen_s"] = ids, stamp_s
        self._known = np.concatenate([found, np.delete(known, old)])
        return ids


def _nearest_pairs(distance_m: AnyArray) -> tuple[AnyArray, AnyArray]:
    """Rows and columns of an (M, N) table of distances that belong together, each at most once, nearest first."""
    rows, columns = np.nonzero(distance_m < _GATE_M)
    order = np.argsort(distance_m[rows, columns], kind="stable")
    rows, columns = rows[order], columns[order]
    chosen: list[int] = []
    used_rows, used_columns = set[int](), set[int]()
    for index, (row, column) in enumerate(zip(rows.tolist(), columns.tolist(), strict=True)):
        if row not in used_rows and column not in used_columns:
            used_rows.add(row)
            used_columns.add(column)
            chosen.append(index)
    return rows[chosen], columns[chosen]
