"""Joins the boxes around all agents of a scene into one table: what they see together.

The ``BOX_DTYPE`` tables of a tick enter, one for each agent; ``joint_dtype`` rows leave. What an object is and how it
moves does not depend on who sees it, so these columns must be the same in all tables, to the bit.
"""

from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.lib.recfunctions import repack_fields

from simbev_ros.foundation.types import BoolArray, Table, UInt8Array
from simbev_ros.schema.boxes import BOX_DTYPE

TOGETHER_DTYPE = np.dtype(
    [
        ("lidar_points", "<i4"),  # points of all lidars of all agents inside the box; -1: none received at this tick
        ("radar_points", "<i4"),
        ("visibility", "<f4"),  # maximum over the agents; NaN: in no image
        ("seen", "u1"),  # 1: an agent has a lidar or radar point inside, or a visible pixel
        ("seen_by", "<u4"),  # bit k: agent k of the specification does, counted from 0
    ]
)
"""Columns that combine those of all agents."""

OBSERVER_DTYPE = np.dtype(
    [
        ("distance", "<f4"),  # as in the agent's own boxes; inf: they lack the object
        ("angle", "<f4"),  # NaN: likewise
        ("lidar_points", "<i4"),  # -1: likewise, or none received at this tick
        ("radar_points", "<i4"),
        ("visibility", "<f4"),  # NaN: likewise, or in no image
        ("on_level", "u1"),  # `on_ego_level` of the agent's own boxes; 255: they lack the object
        ("difficulty", "u1"),
    ]
)
"""Columns that depend on the observer; ``/world/boxes`` has them for each agent, as ``<agent>.<column>``."""

NOT_LISTED = 255
"""Level and difficulty of an object that is not in an agent's table."""

_OF_OBSERVER: Final = ("distance", "angle", "visibility", "lidar_points", "radar_points")
_DERIVED: Final = ("on_ego_level", "valid", "difficulty")
SHARED_DTYPE: Final = np.dtype(
    [(name, BOX_DTYPE[name]) for name in BOX_DTYPE.names or () if name not in (*_OF_OBSERVER, *_DERIVED)]
)
"""Columns of ``BOX_DTYPE`` that do not depend on the observer."""

_SHARED = list(SHARED_DTYPE.names or ())
_COLUMN_ENDS = np.cumsum([SHARED_DTYPE[name].itemsize for name in _SHARED])
_OBSERVED = {name: "on_ego_level" if name == "on_level" else name for name in OBSERVER_DTYPE.names or ()}


class JointBoxes(NamedTuple):
    """Result of joining the tables of a tick.

    Attributes:
        rows: (N,) ``joint_dtype`` of the agents, ascending id: every object that is in one of the tables.
        refused: Why a table was not used, by the name of its agent.
    """

    rows: Table
    refused: Mapping[str, str]


def joint_dtype(names: Sequence[str]) -> np.dtype[np.void]:
    """Row of ``/world/boxes``: shared columns, combined ones, and for each agent those that depend on the observer.

    Args:
        names: All agents of the scene, in the order of the specification.
    """
    of_agents = [(f"{name}.{column}", OBSERVER_DTYPE[column]) for name in names for column in _OBSERVED]
    return np.dtype([*_columns(SHARED_DTYPE), *_columns(TOGETHER_DTYPE), *of_agents])


def join_boxes(names: Sequence[str], tables: Mapping[str, Table]) -> JointBoxes:
    """Join the boxes that the agents of a scene have around them at a tick.

    A table that contradicts those of earlier agents is not used; its agent then has seen nothing.

    Args:
        names: All agents of the scene, in the order of the specification.
        tables: (N,) ``BOX_DTYPE`` of each agent with received boxes, ascending id.
    """
    shared, refused = np.zeros(0, SHARED_DTYPE), dict[str, str]()
    for name in names:
        if name in tables:
            own = np.ascontiguousarray(repack_fields(tables[name][_SHARED]))
            if problem := _contradiction(own, shared):
                refused[name] = problem
            else:
                shared = _merged(shared, own)
    observed = np.stack([_observed(shared, None if name in refused else tables.get(name)) for name in names])
    rows = np.zeros(len(shared), joint_dtype(names))
    for column in _SHARED:
        rows[column] = shared[column]
    _combine(rows, observed)
    for name, of_agent in zip(names, observed, strict=True):
        for column in _OBSERVED:
            rows[f"{name}.{column}"] = of_agent[column]
    return JointBoxes(rows, refused)


def seen_boxes(boxes: Table) -> BoolArray:
    """Whether each box has a lidar or radar point inside, or a visible pixel; (…) rows with the columns of these."""
    seen: BoolArray = (boxes["lidar_points"] > 0) | (boxes["radar_points"] > 0) | (boxes["visibility"] > 0)
    return seen


def _columns(dtype: np.dtype[np.void]) -> list[tuple[str, np.dtype[np.generic]]]:
    return [(name, dtype[name]) for name in dtype.names or ()]


def _contradiction(own: Table, known: Table) -> str:
    """How (N,) rows of ``SHARED_DTYPE`` contradict themselves or (M,) others, both ascending; empty if they do not."""
    if (np.diff(own["id"].astype(np.int64)) <= 0).any():
        return "ids are not ascending"
    _, of_own, of_known = np.intersect1d(own["id"], known["id"], assume_unique=True, return_indices=True)
    if (differing := _bytes_of(own)[of_own] != _bytes_of(known)[of_known]).any():
        row, byte = np.argwhere(differing)[0]
        column = _SHARED[int(np.searchsorted(_COLUMN_ENDS, byte, side="right"))]
        return f"{column} of object {own['id'][of_own[row]]} is not the one that another agent has"
    return ""


def _bytes_of(rows: Table) -> UInt8Array:
    """(N, B) bytes of (N,) contiguous rows."""
    return rows.view(np.uint8).reshape(len(rows), rows.dtype.itemsize)


def _merged(known: Table, own: Table) -> Table:
    """Rows of both tables, ascending id; of objects in both, those of the first one."""
    rows = np.concatenate([known, own])
    result: Table = rows[np.unique(rows["id"], return_index=True)[1]]
    return result


def _observed(shared: Table, boxes: Table | None) -> Table:
    """(N,) ``OBSERVER_DTYPE`` of one agent for (N,) objects, given its boxes; None: it has none."""
    result = np.zeros(len(shared), OBSERVER_DTYPE)
    result["distance"], result["angle"], result["visibility"] = np.inf, np.nan, np.nan
    result["lidar_points"], result["radar_points"] = -1, -1
    result["on_level"], result["difficulty"] = NOT_LISTED, NOT_LISTED
    if boxes is not None:
        listed = np.searchsorted(shared["id"], boxes["id"])
        for column, source in _OBSERVED.items():
            result[column][listed] = boxes[source]
    return result


def _combine(rows: Table, observed: Table) -> None:
    """Fill the columns that combine (A, N) rows of all agents."""
    for column in ("lidar_points", "radar_points"):
        received = observed[column] >= 0
        total = np.where(received, observed[column], 0).sum(axis=0)
        rows[column] = np.where(received.any(axis=0), total, -1)
    rows["visibility"] = np.fmax.reduce(observed["visibility"], axis=0)
    bits = np.left_shift(np.uint32(1), np.arange(len(observed), dtype=np.uint32))
    rows["seen_by"] = np.bitwise_or.reduce(seen_boxes(observed) * bits[:, None], axis=0)
    rows["seen"] = rows["seen_by"] > 0
