"""Markers of boxes, actors, traffic lights and street lights."""

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np

from simbev_ros.drawing.displays.markers import CUBE, SPHERE, balls, lines, replacing_markers
from simbev_ros.drawing.displays.messages import MAP_FRAME, build, color, stamped
from simbev_ros.drawing.displays.serialized_markers import Solids
from simbev_ros.foundation.geometry.transforms import quaternion_from_rpy, rotations_from_rpy
from simbev_ros.foundation.semantics import BOX_CLASSES, Tag
from simbev_ros.foundation.types import Float64Array, Table
from simbev_ros.schema.palette import class_color, rgb_channels, signal_color
from simbev_ros.schema.scene.state import SignalState

_BOX_ALPHA, _ACTOR_ALPHA = 0.5, 0.9
_LINE_WIDTH_M = 0.08
_SIGNAL_SIZE_M, _LAMP_SIZE_M = 0.4, 0.35
_HEADING = build("std_msgs/msg/ColorRGBA", r=1.0, g=1.0, b=1.0, a=0.9)
_VELOCITY = build("std_msgs/msg/ColorRGBA", r=1.0, g=0.75, b=0.1, a=0.9)
_LIT_RGB, _UNLIT_RGB, _BROKEN_RGB = (255, 214, 120), (120, 120, 120), (200, 40, 40)
_MIN_SPEED_MPS = 0.2


def box_markers(boxes: Table, stamp_ns: int) -> bytes:
    """MarkerArray with cubes for boxes, and lines for heading and velocity.

    Each class is a namespace, and the id of a marker is that of its box. All lines of a kind are one marker, which is
    omitted if it has no lines: ``heading`` from the middle of the roof to its front edge, ``velocity`` from the center
    to its position after one second.

    Args:
        boxes: (N,) ``BOX_DTYPE``.
        stamp_ns: Stamp of all markers, which are in the map frame.
    """
    header = stamped(stamp_ns, MAP_FRAME)
    names = [BOX_CLASSES[number] for number in boxes["class"].tolist()]
    rgba = _CLASS_RGBA[boxes["class"]]
    return replacing_markers(header, _cubes_and_lines(header, boxes, _columns(boxes, "x y z"), names, rgba))


def world_markers(actors: Table, signals: Table, lamps: Table, stamp_ns: int) -> bytes:
    """MarkerArray with cubes for actors, lines as in ``box_markers``, and balls for traffic lights and street lights.

    Each semantic tag is a namespace; actors have their own color, traffic lights that of their state. Street lights
    are one marker: lit in the dark, switched off, or broken.

    Args:
        actors: (N,) ``ACTOR_DTYPE``.
        signals: (S,) ``SIGNAL_DTYPE``.
        lamps: (L,) ``STREET_LIGHT_DTYPE``.
        stamp_ns: Stamp of all markers, which are in the map frame.
    """
    header = stamped(stamp_ns, MAP_FRAME)
    ground_m, rpy_rad = _columns(actors, "x y z"), _columns(actors, "roll pitch yaw")
    center_m = ground_m + rotations_from_rpy(rpy_rad)[:, :, 2] * actors["height"][:, None] / 2.0
    names = [Tag(tag).name.lower() for tag in actors["tag"].tolist()]
    rgba = _rgba(map(rgb_channels, actors["color"].tolist()), _ACTOR_ALPHA)
    cubes = _cubes_and_lines(header, actors, center_m, names, rgba)
    return replacing_markers(header, [*cubes, _signal_balls(signals), *_lamp_balls(header, lamps)])


def _cubes_and_lines(
    header: Any, table: Table, center_m: Float64Array, names: Sequence[str], rgba: Float64Array
) -> Iterator[Any]:
    """Cubes, and lines for heading and velocity."""
    rpy_rad, size_m = _columns(table, "roll pitch yaw"), _columns(table, "length width height")
    velocity_mps = _columns(table, "vx vy vz")
    forward, _, up = np.moveaxis(rotations_from_rpy(rpy_rad) * size_m[:, None] / 2.0, -1, 0)
    yield Solids(CUBE, names, table["id"], center_m, quaternion_from_rpy(rpy_rad), size_m, rgba)
    moving = np.linalg.norm(velocity_mps, axis=1) > _MIN_SPEED_MPS
    yield from lines(header, "heading", center_m + up, center_m + up + forward, _HEADING, _LINE_WIDTH_M)
    ends_m = (center_m + velocity_mps)[moving]
    yield from lines(header, "velocity", center_m[moving], ends_m, _VELOCITY, _LINE_WIDTH_M)


def _signal_balls(signals: Table) -> Solids:
    """A sphere at each signal head."""
    count = len(signals)
    rgba = _rgba((signal_color(SignalState(state).name) for state in signals["state"].tolist()), 1.0)
    upright, size_m = np.tile([0.0, 0.0, 0.0, 1.0], (count, 1)), np.full((count, 3), _SIGNAL_SIZE_M)
    names = ["traffic_light"] * count
    return Solids(SPHERE, names, signals["id"], _columns(signals, "x y z"), upright, size_m, rgba)


def _lamp_balls(header: Any, lamps: Table) -> Iterator[Any]:
    """A ball at each street light."""
    colors = [
        color(_BROKEN_RGB if failed else _LIT_RGB if on else _UNLIT_RGB)
        for failed, on in zip(lamps["failed"].tolist(), lamps["on"].tolist(), strict=True)
    ]
    yield from balls(header, "street_light", _columns(lamps, "x y z"), colors, _LAMP_SIZE_M)


def _columns(table: Table, names: str) -> Float64Array:
    """(N, columns) of a table's fields."""
    return np.stack([table[name] for name in names.split()], axis=-1).astype(np.float64)


def _rgba(rgb: Iterable[tuple[int, int, int]], alpha: float) -> Float64Array:
    """(N, 4) colors, 0..1, of sRGB, 0..255."""
    return np.array([(*each, 255.0 * alpha) for each in rgb]).reshape(-1, 4) / 255.0


_CLASS_RGBA = _rgba(map(class_color, BOX_CLASSES), _BOX_ALPHA)
