"""Actor trajectories of a scene, and the true future of every annotated box at every frame.

The recorder feeds each frame's actors to ``Tracker``; the resulting ``Tracks`` are stored with the scene, and dataset
readers derive ``Futures`` from them. Storing each actor's motion once takes about a hundredth of the space that
separate 6 s futures per frame would need.

The file is an ``.npz``, readable without this package, with arrays like those of the Waymo Open Motion Dataset (A
actors, T frames). It is not compressed, as zlib compresses differently from machine to machine::

    tick_ns        ()          length of a tick
    stamp_ns       (T,)        int64, frame stamps, ascending
    id             (A,)        uint32, ascending, as in /world/actors and /ego/boxes
    class          (A,)        uint8, index into class_names
    class_names    (C,)        str
    size_m         (A, 3)      float32, length, width, height
    valid          (A, T)      bool, whether the actor exists; all other values are 0 where it does not
    position_m     (A, T, 3)   float64, center of the box at rest, map frame
    yaw_rad        (A, T)      float32, map frame
    velocity_mps   (A, T, 3)   float32, map frame

``size_m`` is the size at rest and constant, whereas the boxes of /ego/boxes fit the current pose, for example a
pedestrian's stride.
"""

import io
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from simbev_ros.foundation.errors import NPZ_DAMAGE, BagError, InputError
from simbev_ros.foundation.files.unpacking import NpzReader
from simbev_ros.foundation.semantics import BOX_CLASSES
from simbev_ros.foundation.types import (
    AnyArray,
    BoolArray,
    Float32Array,
    Float64Array,
    Int64Array,
    Table,
    UInt8Array,
    UInt32Array,
)
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.schema.boxes import NO_CLASS, box_centers_m

HORIZON_S = 6.0
_MIN_TICK_NS = 1_000_000
"""Length of the shortest tick that a configuration allows."""
_STEP_TOLERANCE = 1e-5
"""Ticks; those of 1/30 s are rounded to nanoseconds."""

_PER_FRAME = ("valid", "position_m", "yaw_rad", "velocity_mps")


@dataclass(frozen=True, eq=False)
class Tracks:
    """Motion of all actors of a scene that have a detection class, including the ego.

    The attributes are the arrays of the file, see the module docstring; ``box_class`` is its ``class``.
    """

    tick_ns: int
    stamp_ns: Int64Array
    id: UInt32Array
    box_class: UInt8Array
    size_m: Float32Array
    valid: BoolArray
    position_m: Float64Array
    yaw_rad: Float32Array
    velocity_mps: Float32Array

    def rows_of(self, ids: UInt32Array) -> Int64Array:
        """(N,) track indices of (N,) actor ids.

        Raises:
            KeyError: An id has no track.
        """
        rows = np.searchsorted(self.id, ids)
        known = self.id[np.minimum(rows, len(self.id) - 1)] == ids if len(self.id) else np.zeros(len(ids), bool)
        if not known.all():
            raise KeyError(f"no track of actor {np.asarray(ids)[~known][0]}")
        return np.asarray(rows, np.int64)


@dataclass(frozen=True, eq=False, slots=True)
class Futures:
    """Motion of N boxes at S times after their frames.

    Attributes:
        after_s: (S,) float64 time after the frame; the first one is one step.
        valid: (N, S) bool, whether the scene lasts until then and the actor exists; all other values are 0 where it is
            False.
        position_m: (N, S, 3) float64 box center, map frame.
        yaw_rad: (N, S) float32 heading, map frame.
        velocity_mps: (N, S, 3) float32 velocity, map frame.
    """

    after_s: Float64Array
    valid: BoolArray
    position_m: Float64Array
    yaw_rad: Float32Array
    velocity_mps: Float32Array


class TrackRecorder:
    """Collects the actors of a scene frame by frame and turns them into ``Tracks``."""

    def __init__(self, tick_ns: int, classes: UInt8Array) -> None:
        """Start without frames.

        Args:
            tick_ns: Length of a tick.
            classes: (B,) index into BOX_CLASSES of each blueprint of the catalog, ``NO_CLASS`` where it has none.
        """
        self._tick_ns = tick_ns
        self._classes = classes
        self._stamps_ns: list[int] = []
        self._frames: list[Table] = []

    def add_frame(self, stamp_ns: int, actors: Table) -> None:
        """Append a frame: (N,) ``ACTOR_DTYPE``, as on /world/actors."""
        self._stamps_ns.append(stamp_ns)
        self._frames.append(_track_rows(actors[self._classes[actors["blueprint"]] != NO_CLASS]))

    def tracks(self) -> Tracks:
        """Tracks of all frames added up to now."""
        rows = np.concatenate([np.empty(0, _ROW_DTYPE), *self._frames])
        ids, first, row = np.unique(rows["id"], return_index=True, return_inverse=True)
        frame = np.repeat(np.arange(len(self._frames)), [len(frame_rows) for frame_rows in self._frames])
        shape = len(ids), len(self._frames)
        per_frame = {name: np.zeros((*shape, *_ROW_DTYPE[name].shape), _ROW_DTYPE[name].base) for name in _PER_FRAME}
        for name, values in per_frame.items():
            values[row, frame] = rows[name]
        return Tracks(
            tick_ns=self._tick_ns,
            stamp_ns=np.array(self._stamps_ns, np.int64),
            id=ids,
            box_class=self._classes[rows["blueprint"][first]],
            size_m=rows["size_m"][first],
            **per_frame,
        )


def futures(
    tracks: Tracks, ids: UInt32Array, stamps_ns: Int64Array, horizon_s: float = HORIZON_S, step_s: float | None = None
) -> Futures:
    """Ground-truth futures of boxes, for one frame or for a batch of frames.

    Args:
        tracks: Tracks of the scene.
        ids: (N,) actor ids.
        stamps_ns: (N,) stamp of the frame that each box belongs to.
        horizon_s: Prediction horizon, s; the last time is the last whole step within it.
        step_s: Time between positions, s; None: one tick.

    Raises:
        InputError: The step is not a whole number of ticks, or longer than the horizon.
        KeyError: An id has no track.
    """
    step_ticks = 1.0 if step_s is None else step_s * NS_PER_S / tracks.tick_ns
    step_ns = round(step_ticks) * tracks.tick_ns
    if step_ns <= 0 or abs(step_ticks - round(step_ticks)) > _STEP_TOLERANCE:
        raise InputError(f"step_s: {step_s:g} is not a whole number of ticks of {tracks.tick_ns / NS_PER_S:g} s")
    count = int(horizon_s * NS_PER_S / step_ns + _STEP_TOLERANCE)
    if count < 1:
        raise InputError(f"horizon_s: {horizon_s:g} is shorter than a step of {step_ns / NS_PER_S:g} s")
    after_ns = step_ns * np.arange(1, count + 1)
    wanted_ns = np.asarray(stamps_ns, np.int64)[:, None] + after_ns
    frame = np.minimum(np.searchsorted(tracks.stamp_ns, wanted_ns), len(tracks.stamp_ns) - 1)
    row = tracks.rows_of(ids)[:, None]
    valid = (tracks.stamp_ns[frame] == wanted_ns) & tracks.valid[row, frame]
    return Futures(
        after_s=after_ns / NS_PER_S,
        valid=valid,
        position_m=np.where(valid[..., None], tracks.position_m[row, frame], 0.0),
        yaw_rad=np.where(valid, tracks.yaw_rad[row, frame], np.float32(0.0)),
        velocity_mps=np.where(valid[..., None], tracks.velocity_mps[row, frame], np.float32(0.0)),
    )


def tracks_to_npz(tracks: Tracks) -> bytes:
    """Serialize tracks as an ``.npz`` file; equal tracks give equal bytes, on every machine."""
    arrays = {field.name: np.asarray(getattr(tracks, field.name)) for field in fields(Tracks)}
    arrays["class"] = arrays.pop("box_class")
    file = io.BytesIO()
    np.savez(file, class_names=np.array(BOX_CLASSES), **arrays)  # type: ignore[arg-type]
    return file.getvalue()


def tracks_from_npz(file: bytes) -> Tracks:
    """Read tracks from the bytes of an ``.npz`` file.

    Raises:
        BagError: The file is damaged, exceeds a limit, or was not written by ``tracks_to_npz``.
    """
    try:
        arrays = NpzReader(io.BytesIO(file))
        class_names = arrays["class_names"].tolist()
        values: dict[str, Any] = {
            field.name: arrays[field.name] for field in fields(Tracks) if field.name != "box_class"
        }
        values["class"] = arrays["class"]
        _require_layout(values)
        box_class = np.array([BOX_CLASSES.index(name) for name in class_names], np.uint8)[values.pop("class")]
    except NPZ_DAMAGE as error:
        raise BagError(f"the trajectories are damaged: {error}") from None
    return Tracks(**{**values, "tick_ns": int(values["tick_ns"]), "box_class": box_class})


def _require_layout(arrays: Mapping[str, AnyArray]) -> None:
    """Raise ValueError unless the arrays of a file have types, shapes and orders as the module docstring says."""
    sizes = {"A": arrays["id"].size, "T": arrays["stamp_ns"].size}
    for name, (dtype, axes) in _LAYOUT.items():
        array, shape = arrays[name], tuple(sizes.get(axis, 3) for axis in axes)
        if array.dtype != dtype or array.shape != shape:
            raise ValueError(f"{name} is {array.dtype} of the shape {array.shape}; it must be {dtype} of {shape}")
    for name in ("id", "stamp_ns"):
        if not (arrays[name][1:] > arrays[name][:-1]).all():
            raise ValueError(f"{name} must ascend")
    if not _MIN_TICK_NS <= arrays["tick_ns"] <= NS_PER_S:
        raise ValueError(f"tick_ns is {arrays['tick_ns']}; allowed: {_MIN_TICK_NS} to {NS_PER_S}")


_LAYOUT = {
    "tick_ns": ("int64", ""),
    "stamp_ns": ("int64", "T"),
    "id": ("uint32", "A"),
    "class": ("uint8", "A"),
    "size_m": ("float32", "A3"),
    "valid": ("bool", "AT"),
    "position_m": ("float64", "AT3"),
    "yaw_rad": ("float32", "AT"),
    "velocity_mps": ("float32", "AT3"),
}
"""Type and axes of each array of the file: A actors, T frames, 3 components."""

_ROW_DTYPE = np.dtype(
    [
        ("id", "<u4"),
        ("blueprint", "<u2"),
        ("size_m", "<f4", 3),
        ("valid", "?"),
        ("position_m", "<f8", 3),
        ("yaw_rad", "<f4"),
        ("velocity_mps", "<f4", 3),
    ]
)


def _track_rows(actors: Table) -> Table:
    """The columns of (N,) actors of a frame that tracks keep."""
    rows = np.empty(len(actors), _ROW_DTYPE)
    rows["id"], rows["blueprint"], rows["valid"] = actors["id"], actors["blueprint"], True
    rows["size_m"] = np.stack([actors["length"], actors["width"], actors["height"]], axis=1)
    rows["position_m"] = box_centers_m(actors)
    rows["yaw_rad"] = actors["yaw"]
    rows["velocity_mps"] = np.stack([actors["vx"], actors["vy"], actors["vz"]], axis=1)
    return rows
