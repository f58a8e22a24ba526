"""Entities as messages of simulation_interfaces: states, bounds and filters, from and to rows of the actors table."""

import re
from importlib import import_module
from typing import Any
from warnings import catch_warnings

import numpy as np

from simbev_ros.foundation.geometry.transforms import matrices_from_xyz_quaternion, quaternion_from_rpy
from simbev_ros.foundation.types import Float64Array, Table
from simbev_ros.ros.conventions.simulation_interfaces import Refused
from simbev_ros.ros.msgs.stamps import header
from simbev_ros.ros.msgs.world import MAP_FRAME, point_message, quaternion_message, vector_message
from simbev_ros.schema.scene.state import map_from_actors

_MAX_PATTERN_CHARS, _MAX_REPETITIONS, _MAX_POINTS = 200, 4, 100
_POSIX = {"alpha": "A-Za-z", "digit": "0-9", "alnum": "A-Za-z0-9", "upper": "A-Z", "lower": "a-z", "space": r"\s"}
"""Classes of POSIX's bracket expressions, as Python writes them."""
_PLAIN_GROUP = re.compile(r"\([^()|*+?{]*\)")
_UNIT_TOLERANCE = 0.01
_MAX_RATE = 1000.0  # per axis, in m/s, m/s², rad/s and rad/s²: what moves stays where numbers are finite
_VECTORS = ("vx", "vy", "vz"), ("wx", "wy", "wz"), ("ax", "ay", "az")


def state_message(row: Table, stamp_ns: int) -> Any:
    """EntityState, in the map frame, of one ``ACTOR_DTYPE`` row; the angular acceleration is left out."""
    message = import_module("simulation_interfaces.msg").EntityState(header=header(stamp_ns, MAP_FRAME))
    message.pose.position = point_message(np.array([row["x"], row["y"], row["z"]]))
    rpy_rad = np.array([row["roll"], row["pitch"], row["yaw"]], np.float64)
    message.pose.orientation = quaternion_message(quaternion_from_rpy(rpy_rad))
    velocity, rates, acceleration = (vector_message(np.array([row[name] for name in names])) for names in _VECTORS)
    message.twist.linear, message.twist.angular, message.acceleration.linear = velocity, rates, acceleration
    return message


def box_message(low_m: Float64Array, high_m: Float64Array) -> Any:
    """Bounds of a box between its (3,) lower and (3,) upper corner."""
    bounds = import_module("simulation_interfaces.msg").Bounds
    return bounds(type=bounds.TYPE_BOX, points=[vector_message(high_m), vector_message(low_m)])


def size_message(length_m: float, width_m: float, height_m: float) -> Any:
    """Bounds of an actor in its own frame, whose origin is the center of the bottom face."""
    half_m = np.array([length_m, width_m, 0.0]) / 2.0
    return box_message(-half_m, half_m + np.array([0.0, 0.0, height_m]))


def matrix_of_pose(pose: Any) -> Float64Array:
    """(4, 4) transform to the frame of a pose.

    Raises:
        Refused: It has numbers that are not finite, or its quaternion is none of a rotation.
    """
    xyz_m = np.array([pose.position.x, pose.position.y, pose.position.z])
    xyzw = np.array([pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w])
    if not (np.isfinite(xyz_m).all() and np.isfinite(xyzw).all()):
        raise Refused("INVALID_POSE", "pose: has numbers that are not finite")
    if abs(np.linalg.norm(xyzw) - 1.0) > _UNIT_TOLERANCE:
        raise Refused("INVALID_POSE", f"pose.orientation: has length {np.linalg.norm(xyzw):.3g}; must be 1")
    return matrices_from_xyz_quaternion(xyz_m, xyzw / np.linalg.norm(xyzw))


def vectors_of(motion: Any, rotation: Float64Array, field: str) -> tuple[Float64Array, Float64Array]:
    """Linear and angular (3,) vector of a Twist or an Accel, in the frame that a (3, 3) rotation leads to.

    Raises:
        Refused: They have numbers that are not finite, or above 1000.
    """
    vectors = np.array([[each.x, each.y, each.z] for each in (motion.linear, motion.angular)])
    if not np.isfinite(vectors).all():
        raise Refused("RESULT_OPERATION_FAILED", f"{field}: has numbers that are not finite")
    if np.abs(vectors).max() > _MAX_RATE:
        raise Refused("RESULT_OPERATION_FAILED", f"{field}: has numbers above {_MAX_RATE:g}")
    linear, angular = vectors @ rotation.T
    return linear, angular


def name_pattern(text: str) -> re.Pattern[str]:
    """A POSIX extended regular expression as one of Python.

    Raises:
        Refused: It is none, or it might take long: more than four repetitions, or a repeated group with any choice.
    """
    if len(text) > _MAX_PATTERN_CHARS:
        raise Refused("RESULT_OPERATION_FAILED", f"filter: is longer than {_MAX_PATTERN_CHARS} characters")
    translated = re.sub(r"\[:(\w+):\]", lambda found: _POSIX.get(found[1], found[0]), text)
    bare = re.sub(r"\\.|\[\^?\]?[^]]*\]", "x", translated)
    if len(re.findall(r"[*+?{]", bare)) > _MAX_REPETITIONS or re.search(r"\)[*+?{]", _PLAIN_GROUP.sub("x", bare)):
        raise Refused("RESULT_OPERATION_FAILED", "filter: has too many repetitions, or one of a group with choices")
    try:
        with catch_warnings(action="ignore"):
            return re.compile(translated)
    except (re.error, OverflowError) as error:
        raise Refused("RESULT_OPERATION_FAILED", f"filter: is not a regular expression: {error}") from None


def overlapping(rows: Table, bounds: Any) -> list[bool]:
    """Whether the box of each of (N,) ``ACTOR_DTYPE`` rows overlaps bounds in the map frame.

    Raises:
        Refused: The bounds are not as their type demands, or have too many points.
    """
    if len(bounds.points) > _MAX_POINTS:
        raise Refused("RESULT_OPERATION_FAILED", f"filters.bounds: has more than {_MAX_POINTS} points")
    points_m = np.array([[each.x, each.y, each.z] for each in bounds.points]).reshape(-1, 3)
    if bounds.type == bounds.TYPE_EMPTY or not len(points_m):
        return [True] * len(rows)
    expected = {bounds.TYPE_BOX: 2, bounds.TYPE_SPHERE: 2}.get(bounds.type, 3)
    if bounds.type > bounds.TYPE_SPHERE or not np.isfinite(points_m).all():
        raise Refused("RESULT_OPERATION_FAILED", "filters.bounds: has an unknown type, or points that are not finite")
    if len(points_m) < expected or (len(points_m) > expected and bounds.type != bounds.TYPE_CONVEX_HULL):
        raise Refused("RESULT_OPERATION_FAILED", f"filters.bounds: has {len(points_m)} points; needed: {expected}")
    half_m = np.column_stack([rows["length"], rows["width"], rows["height"]]).astype(np.float64) / 2.0
    poses = map_from_actors(rows)
    center_m = poses[:, :3, 3] + half_m[:, 2:] * poses[:, :3, 2]
    if bounds.type == bounds.TYPE_SPHERE:
        own_m = np.einsum("ni,nij->nj", points_m[0] - center_m, poses[:, :3, :3])
        outside_m = np.linalg.norm(np.maximum(np.abs(own_m) - half_m, 0.0), axis=1)
        return [bool(each) for each in outside_m <= points_m[1, 0]]
    if bounds.type == bounds.TYPE_BOX:
        points_m = np.array(np.meshgrid(*points_m.T)).reshape(3, -1).T
    reach_m = np.linalg.norm(half_m, axis=1)[:, None]
    near = ((points_m.min(axis=0) - reach_m <= center_m) & (center_m <= points_m.max(axis=0) + reach_m)).all(axis=1)
    corners = np.array(np.meshgrid(*[(-1.0, 1.0)] * 3)).reshape(3, -1).T
    boxes_m = center_m[:, None] + (corners * half_m[:, None]) @ poses[:, :3, :3].swapaxes(1, 2)
    return [bool(is_near) and _hulls_meet(box_m, points_m) for is_near, box_m in zip(near, boxes_m, strict=True)]


def _hulls_meet(a_m: Float64Array, b_m: Float64Array) -> bool:
    """Whether the convex hulls of (A, 3) and (B, 3) points share a point, as a linear program."""
    from scipy.optimize import linprog

    ones = np.ones((1, len(a_m))), np.ones((1, len(b_m)))
    weights = np.block([[a_m.T, -b_m.T], [ones[0], 0.0 * ones[1]], [0.0 * ones[0], ones[1]]])
    return bool(linprog(np.zeros(weights.shape[1]), A_eq=weights, b_eq=[0.0, 0.0, 0.0, 1.0, 1.0]).success)
