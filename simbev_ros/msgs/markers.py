"""Boxes → markers for RViz and Foxglove."""

from functools import lru_cache

import numpy as np
from geometry_msgs.msg import Point, Pose, Quaternion, Vector3
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from simbev_ros.geometry.transforms import quaternion_from_rpy, rotations_from_rpy
from simbev_ros.msgs.stamps import header
from simbev_ros.msgs.world import MAP_FRAME
from simbev_ros.palette import class_color
from simbev_ros.semantics import BOX_CLASSES
from simbev_ros.types import Float64Array, Table

_ALPHA = 0.5
_LINE_M = 0.08
_HEADING, _VELOCITY = (1.0, 1.0, 1.0, 0.9), (1.0, 0.75, 0.1, 0.9)
_MOVES_MPS = 0.2


def box_markers(boxes: Table, stamp_ns: int) -> MarkerArray:
    """A cube for each box, in a namespace for each class, with the box's id; and lines that show where boxes go.

    A DELETEALL before them removes what has gone, so nothing has a lifetime: it would run out where a simulation is
    slower than its clock, or paused. Of the lines, all of a kind are one marker: ``heading`` from the middle of the
    roof to its front edge, ``velocity`` from the centre to where it is in a second; there is none without lines.

    Args:
        boxes: (N,) ``BOX_DTYPE``.
        stamp_ns: Stamp of all markers, which are in the map frame.
    """
    stamped = header(stamp_ns, MAP_FRAME)
    center_m, rpy_rad, size_m, velocity_mps = (
        np.stack([boxes[name] for name in names.split()], axis=-1).astype(np.float64)
        for names in ("x y z", "roll pitch yaw", "length width height", "vx vy vz")
    )
    forward, _, up = np.moveaxis(rotations_from_rpy(rpy_rad) * size_m[:, None] / 2.0, -1, 0)
    moving = np.linalg.norm(velocity_mps, axis=1) > _MOVES_MPS
    lines = [
        ("heading", center_m + up, center_m + up + forward, _HEADING),
        ("velocity", center_m[moving], (center_m + velocity_mps)[moving], _VELOCITY),
    ]
    places, turns = center_m.tolist(), quaternion_from_rpy(rpy_rad).tolist()
    rows = zip(boxes["class"].tolist(), boxes["id"].tolist(), places, turns, size_m.tolist(), strict=True)
    return MarkerArray(
        markers=[
            Marker(header=stamped, action=Marker.DELETEALL),
            *(_cube(stamped, BOX_CLASSES[number], *rest) for number, *rest in rows),
            *(_lines(stamped, name, starts, ends, rgba) for name, starts, ends, rgba in lines if len(starts)),
        ]
    )


def _cube(
    stamped: Header, name: str, identity: int, place_m: list[float], xyzw: list[float], size_m: list[float]
) -> Marker:
    """A box."""
    (x, y, z), (qx, qy, qz, qw), (length, width, height) = place_m, xyzw, size_m
    pose = Pose(position=Point(x=x, y=y, z=z), orientation=Quaternion(x=qx, y=qy, z=qz, w=qw))
    scale = Vector3(x=length, y=width, z=height)
    return Marker(header=stamped, ns=name, id=identity, type=Marker.CUBE, pose=pose, scale=scale, color=_color(name))


def _lines(
    stamped: Header, name: str, starts_m: Float64Array, ends_m: Float64Array, rgba: tuple[float, float, float, float]
) -> Marker:
    """Lines between (N, 3) points, as one marker."""
    red, green, blue, alpha = rgba
    points = [Point(x=x, y=y, z=z) for x, y, z in np.stack([starts_m, ends_m], axis=1).reshape(-1, 3).tolist()]
    color, scale = ColorRGBA(r=red, g=green, b=blue, a=alpha), Vector3(x=_LINE_M, y=_LINE_M, z=_LINE_M)
    return Marker(header=stamped, ns=name, id=0, type=Marker.LINE_LIST, points=points, scale=scale, color=color)


@lru_cache(maxsize=len(BOX_CLASSES))
def _color(name: str) -> ColorRGBA:
    red, green, blue = (channel / 255.0 for channel in class_color(name))
    return ColorRGBA(r=red, g=green, b=blue, a=_ALPHA)
