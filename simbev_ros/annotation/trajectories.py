"""Where everything goes: the tracks of a scene's actors, and from them the true future of each box of each frame.

A scene's future is known when it is over. It is kept as tracks, each actor's motion once, from which the futures of all
frames are views: a hundredth of what futures of 6 s would take for every frame. As a file it is an ``.npz``, so that
it can be read without this package, with arrays in the manner of the Waymo Open Motion Dataset (A actors, T frames)::

    tick_ns        ()          length of a tick
    stamp_ns       (T,)        int64, of the frames, ascending
    id             (A,)        uint32, ascending, as in /world/actors and /ego/boxes
    class          (A,)        uint8, index into class_names
    class_names    (C,)        str
    size_m         (A, 3)      float32, length, width, height
    valid          (A, T)      bool, whether the actor is there; all else is 0 where it is not
    position_m     (A, T, 3)   float64, centre of the box at rest, map frame
    yaw_rad        (A, T)      float32, map frame
    velocity_mps   (A, T, 3)   float32, map frame

Sizes are those at rest and do not change; a box of /ego/boxes fits its actor's pose, a person's stride for one.
"""

import io
from dataclasses import dataclass, fields

import numpy as np

from simbev_ros.annotation.boxes.boxes import NO_CLASS, box_centers_m, class_of_blueprint
from simbev_ros.errors import NPZ_DAMAGE, BagError, InputError
from simbev_ros.scene.spec import NS_PER_S
from simbev_ros.semantics import BOX_CLASSES
from simbev_ros.types import BoolArray, Float32Array, Float64Array, Int64Array, Table, UInt8Array, UInt32Array

HORIZON_S = 6.0

_MOVING = ("valid", "position_m", "yaw_rad", "velocity_mps")


@dataclass(frozen=True, eq=False)
class Tracks:
    """All actors of a scene that have a detection class, the ego among them.

    Attributes are those of the file, but for ``box_class``, which is its ``class``.
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
        """(N,) rows of (N,) ids.

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
    """What N boxes do at S times after their frames.

    Attributes:
        after_s: (S,) float64 the times, the first one step after the frame.
        valid: (N, S) whether the scene goes on until then, and the actor is there; all else is 0 where not.
        position_m: (N, S, 3) float64 centre of the box, map frame.
        yaw_rad: (N, S) float32 map frame.
        velocity_mps: (N, S, 3) float32 map frame.
    """

    after_s: Float64Array
    valid: BoolArray
    position_m: Float64Array
    yaw_rad: Float32Array
    velocity_mps: Float32Array


class Tracker:
    """Follows all actors of a scene, frame by frame."""

    def __init__(self, tick_ns: int) -> None:
        self._tick_ns = tick_ns
        self._classes = class_of_blueprint()
        self._stamps_ns: list[int] = []
        self._parts: list[Table] = []

    def add(self, stamp_ns: int, actors: Table) -> None:
        """The next frame: (N,) ``ACTOR_DTYPE``, as on /world/actors."""
        self._stamps_ns.append(stamp_ns)
        self._parts.append(_part(actors[self._classes[actors["blueprint"]] != NO_CLASS]))

    def tracks(self) -> Tracks:
        """Those of all frames so far."""
        every = np.concatenate([np.empty(0, _PART_DTYPE), *self._parts])
        ids, first, row = np.unique(every["id"], return_index=True, return_inverse=True)
        frame = np.repeat(np.arange(len(self._parts)), [len(part) for part in self._parts])
        shape = len(ids), len(self._parts)
        moving = {name: np.zeros((*shape, *_PART_DTYPE[name].shape), _PART_DTYPE[name].base) for name in _MOVING}
        for name, values in moving.items():
            values[row, frame] = every[name]
        return Tracks(
            tick_ns=self._tick_ns,
            stamp_ns=np.array(self._stamps_ns, np.int64),
            id=ids,
            box_class=self._classes[every["blueprint"][first]],
            size_m=every["size_m"][first],
            **moving,
        )


def futures(
    tracks: Tracks, ids: UInt32Array, stamps_ns: Int64Array, horizon_s: float = HORIZON_S, step_s: float | None = None
) -> Futures:
    """The futures of boxes, of one frame or of many at once.

    Args:
        tracks: Of the scene.
        ids: (N,) actors.
        stamps_ns: (N,) the frames that their boxes are of.
        horizon_s: How far to look ahead; the last time is the last whole step within.
        step_s: Time between places; None: a tick.

    Raises:
        InputError: The step is no whole number of ticks, or the horizon is shorter.
        KeyError: An id has no track.
    """
    step_ns = tracks.tick_ns if step_s is None else round(step_s * NS_PER_S)
    if step_ns <= 0 or step_ns % tracks.tick_ns:
        raise InputError(f"step_s: {step_s:g} is not a whole number of ticks of {tracks.tick_ns / NS_PER_S:g} s")
    count = round(horizon_s * NS_PER_S) // step_ns
    if count < 1:
        raise InputError(f"horizon_s: {horizon_s:g} is less than a step of {step_ns / NS_PER_S:g} s")
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


def npz_of(tracks: Tracks) -> bytes:
    """The file of some tracks; of the same tracks the same bytes."""
    arrays = {field.name: np.asarray(getattr(tracks, field.name)) for field in fields(Tracks)}
    arrays["class"] = arrays.pop("box_class")
    file = io.BytesIO()
    np.savez_compressed(file, class_names=np.array(BOX_CLASSES), **arrays)  # type: ignore[arg-type]
    return file.getvalue()


def tracks_of_npz(file: bytes) -> Tracks:
    """The tracks in a file.

    Raises:
        BagError: It is not one that ``npz_of`` makes.
    """
    try:
        with np.load(io.BytesIO(file), allow_pickle=False) as arrays:
            known = arrays["class_names"].tolist()
            values = {field.name: arrays[field.name] for field in fields(Tracks) if field.name != "box_class"}
            numbers = np.array([BOX_CLASSES.index(name) for name in known], np.uint8)[arrays["class"]]
    except NPZ_DAMAGE as error:
        raise BagError(f"the trajectories are damaged: {error}") from None
    return Tracks(**{**values, "tick_ns": int(values["tick_ns"]), "box_class": numbers})


_PART_DTYPE = np.dtype(
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


def _part(actors: Table) -> Table:
    """What tracks keep of (N,) actors of a frame."""
    part = np.empty(len(actors), _PART_DTYPE)
    part["id"], part["blueprint"], part["valid"] = actors["id"], actors["blueprint"], True
    part["size_m"] = np.stack([actors["length"], actors["width"], actors["height"]], axis=1)
    part["position_m"] = box_centers_m(actors)
    part["yaw_rad"] = actors["yaw"]
    part["velocity_mps"] = np.stack([actors["vx"], actors["vy"], actors["vz"]], axis=1)
    return part
