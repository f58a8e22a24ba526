"""Tables as clouds of float32, for RViz, which draws no cloud with float64 positions."""

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache

import numpy as np

from simbev_ros.drawing.displays.messages import CLOUD, MAP_FRAME, build, serialize, stamped
from simbev_ros.foundation.semantics import BOX_CLASSES
from simbev_ros.foundation.types import AnyArray, Float32Array, Table, UInt32Array
from simbev_ros.schema.palette import class_color, signal_color
from simbev_ros.schema.scene.state import SignalState

_FLOAT32 = 7  # PointField.FLOAT32
_UNKNOWN = 0x808080
_AXES = ("x", "y", "z")
_VELOCITY = ("vx", "vy", "vz")


def table_points(table: Table, stamp_ns: int) -> bytes:
    """PointCloud2 with the columns of a table in their order, all float32, in the map frame.

    Two columns follow: ``speed``, m/s, if the table has velocities, and ``rgb``, packed as in PCL, if it has colors or
    what determines them. Positions are rounded to 1 mm at 8 km from the map's origin, to 6 cm at 1,000 km.

    Args:
        table: (N,) rows of ``BOX_DTYPE``, ``ACTOR_DTYPE``, ``SIGNAL_DTYPE`` or ``STREET_LIGHT_DTYPE``.
        stamp_ns: Stamp.
    """
    columns = _columns(table)
    data = np.stack(list(columns.values()), axis=1)
    fields = [
        build("sensor_msgs/msg/PointField", name=name, offset=4 * number, datatype=_FLOAT32, count=1)
        for number, name in enumerate(columns)
    ]
    return serialize(
        build(
            CLOUD,
            header=stamped(stamp_ns, MAP_FRAME),
            height=1,
            width=len(table),
            fields=fields,
            point_step=4 * len(columns),
            row_step=data.nbytes,
            data=data.reshape(-1).view(np.uint8),
            is_dense=all(bool(np.isfinite(columns[axis]).all()) for axis in _AXES),
        )
    )


def _columns(table: Table) -> dict[str, Float32Array]:
    """(N,) values by column."""
    names = table.dtype.names or ()
    columns: dict[str, Float32Array] = {name: table[name].astype(np.float32) for name in names}
    if set(_VELOCITY) <= set(names):
        columns["speed"] = np.asarray(np.linalg.norm([columns[name] for name in _VELOCITY], axis=0), np.float32)
    for name, color in _COLORS.items():
        if name in names:
            columns["rgb"] = color(table[name]).astype(np.uint32).view(np.float32)
            break
    return columns


@lru_cache(maxsize=1)
def _class_colors() -> UInt32Array:
    """(256,) colors of box classes, 0xRRGGBB."""
    return _packed([class_color(name) for name in BOX_CLASSES])


@lru_cache(maxsize=1)
def _state_colors() -> UInt32Array:
    """(256,) colors of traffic lights' states, 0xRRGGBB."""
    return _packed([signal_color(state.name) for state in SignalState])


def _packed(colors: Sequence[tuple[int, int, int]]) -> UInt32Array:
    """(256,) colors of the values of a uint8 column; values that mean nothing are gray."""
    table = np.full(256, _UNKNOWN, np.uint32)
    table[: len(colors)] = [red << 16 | green << 8 | blue for red, green, blue in colors]
    return table


_COLORS: Mapping[str, Callable[[AnyArray], AnyArray]] = {
    "class": lambda classes: _class_colors()[classes],
    "color": lambda packed: packed,
    "state": lambda states: _state_colors()[states],
}
"""Colors, 0xRRGGBB, that follow from a column; the first of these that a table has determines its color."""
