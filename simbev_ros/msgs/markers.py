"""Converts boxes, actors and traffic lights to markers for RViz and Foxglove."""

from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache

import numpy as np
from geometry_msgs.msg import Point, Pose, Quaternion, Vector3
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from simbev_ros.geometry.transforms import quaternion_from_rpy, rotations_from_rpy
from simbev_ros.msgs.stamps import header
from simbev_ros.msgs.world import MAP_FRAME
from simbev_ros.palette import class_color, signal_color
from simbev_ros.scene.state import SignalState, WorldState
from simbev_ros.semantics import BOX_CLASSES, Tag
from simbev_ros.types import Float64Array, Table

_BOX_ALPHA, _ACTOR_ALPHA = 0.5, 0.9
_LINE_WIDTH_M = 0.08
_SIGNAL_SIZE_M = 0.4
_HEADING_RGBA, _VELOCITY_RGBA = (1.0, 1.0, 1.0, 0.9), (1.0, 0.75, 0.1, 0.9)
_MIN_SPEED_MPS = 0.2


def box_markers(boxes: Table, stamp_ns: int) -> MarkerArray:
    """Cube markers for boxes, with lines for heading and velocity.

    Each class is a namespace, and the id of a marker is that of its box. All lines of a kind are one marker, which is
    omitted if it has no lines: ``heading`` from the middle of the roof to its front edge, ``velocity`` from the center
    to its position after one second.

    Args:
        boxes: (N,) ``BOX_DTYPE``.
        stamp_ns: Stamp of all markers, which are in the map frame.
    """
    stamped = header(stamp_ns, MAP_FRAME)
    names = [BOX_CLASSES[number] for number in boxes["class"].tolist()]
    colors = [_color(class_color(name), _BOX_ALPHA) for name in names]
    return _replace_previous_markers(stamped, _cubes_and_lines(stamped, boxes, _columns(boxes, "x y z"), names, colors))


def world_markers(state: WorldState) -> MarkerArray:
    """Cube markers for actors, with lines as in ``box_markers``, and spheres for traffic lights.

    Each semantic tag is a namespace; actors have their own color, and traffic lights that of their state.
    """
    stamped, actors = header(state.stamp_ns, MAP_FRAME), state.actors
    ground_m, rpy_rad = _columns(actors, "x y z"), _columns(actors, "roll pitch yaw")
    center_m = ground_m + rotations_from_rpy(rpy_rad)[:, :, 2] * actors["height"][:, None] / 2.0
    names = [Tag(tag).name.lower() for tag in actors["tag"].tolist()]
    colors = [_color((code >> 16, code >> 8 & 255, code & 255), _ACTOR_ALPHA) for code in actors["color"].tolist()]
    markers = [*_cubes_and_lines(stamped, actors, center_m, names, colors), *_signal_balls(stamped, state.signals)]
    return _replace_previous_markers(stamped, markers)


def _replace_previous_markers(stamped: Header, markers: Iterable[Marker]) -> MarkerArray:
    """Put a DELETEALL before the markers.

    It removes markers that have disappeared, so none needs a lifetime, which would run out if a simulation is paused or
    slower than its clock.
    """
    return MarkerArray(markers=[Marker(header=stamped, action=Marker.DELETEALL), *markers])


def _cubes_and_lines(
    stamped: Header, table: Table, center_m: Float64Array, names: Sequence[str], colors: Sequence[ColorRGBA]
) -> Iterator[Marker]:
    """Cubes, and lines for heading and velocity."""
    rpy_rad, size_m = _columns(table, "roll pitch yaw"), _columns(table, "length width height")
    velocity_mps = _columns(table, "vx vy vz")
    forward, _, up = np.moveaxis(rotations_from_rpy(rpy_rad) * size_m[:, None] / 2.0, -1, 0)
    orientations = quaternion_from_rpy(rpy_rad).tolist()
    rows = zip(names, table["id"].tolist(), center_m.tolist(), orientations, size_m.tolist(), colors, strict=True)
    yield from (_cube(stamped, *row) for row in rows)
    moving = np.linalg.norm(velocity_mps, axis=1) > _MIN_SPEED_MPS
    yield from _lines(stamped, "heading", center_m + up, center_m + up + forward, _HEADING_RGBA)
    yield from _lines(stamped, "velocity", center_m[moving], (center_m + velocity_mps)[moving], _VELOCITY_RGBA)


def _signal_balls(stamped: Header, signals: Table) -> Iterator[Marker]:
    """A sphere at each signal head."""
    for position, identity, state in zip(
        _columns(signals, "x y z").tolist(), signals["id"].tolist(), signals["state"].tolist(), strict=True
    ):
        color = _color(signal_color(SignalState(state).name), 1.0)
        ball = (position, [0.0, 0.0, 0.0, 1.0], [_SIGNAL_SIZE_M] * 3)
        yield _cube(stamped, "traffic_light", identity, *ball, color, Marker.SPHERE)


def _cube(
    stamped: Header,
    name: str,
    identity: int,
    position_m: list[float],
    xyzw: list[float],
    size_m: list[float],
    color: ColorRGBA,
    kind: int = Marker.CUBE,
) -> Marker:
    """A cube, or a sphere inscribed in one."""
    (x, y, z), (qx, qy, qz, qw), (length, width, height) = position_m, xyzw, size_m
    pose = Pose(position=Point(x=x, y=y, z=z), orientation=Quaternion(x=qx, y=qy, z=qz, w=qw))
    scale = Vector3(x=length, y=width, z=height)
    return Marker(header=stamped, ns=name, id=identity, type=kind, pose=pose, scale=scale, color=color)


def _lines(
    stamped: Header, name: str, starts_m: Float64Array, ends_m: Float64Array, rgba: tuple[float, float, float, float]
) -> Iterator[Marker]:
    """Marker with lines between (N, 3) points; no marker if there are none."""
    if not len(starts_m):
        return
    red, green, blue, alpha = rgba
    points = [Point(x=x, y=y, z=z) for x, y, z in np.stack([starts_m, ends_m], axis=1).reshape(-1, 3).tolist()]
    color, scale = (
        ColorRGBA(r=red, g=green, b=blue, a=alpha),
        Vector3(x=_LINE_WIDTH_M, y=_LINE_WIDTH_M, z=_LINE_WIDTH_M),
    )
    yield Marker(header=stamped, ns=name, id=0, type=Marker.LINE_LIST, points=points, scale=scale, color=color)


def _columns(table: Table, names: str) -> Float64Array:
    """(N, columns) of a table's fields."""
    return np.stack([table[name] for name in names.split()], axis=-1).astype(np.float64)


@lru_cache(maxsize=256)
def _color(rgb: tuple[int, int, int], alpha: float) -> ColorRGBA:
    red, green, blue = (channel / 255.0 for channel in rgb)
    return ColorRGBA(r=red, g=green, b=blue, a=alpha)
