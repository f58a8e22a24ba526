"""Converts between the world state and ROS messages."""

import json
from dataclasses import asdict
from typing import Any

import numpy as np
from geometry_msgs.msg import Point, Quaternion, Vector3
from nav_msgs.msg import Odometry
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import String

from simbev_ros.foundation.files.structured_text import parse_json
from simbev_ros.foundation.geometry.transforms import (
    matrices_from_xyz_quaternion,
    quaternion_from_rpy,
    rotations_from_rpy,
    with_signs_of,
)
from simbev_ros.foundation.types import Float64Array, Table
from simbev_ros.ros.msgs.stamps import header
from simbev_ros.ros.msgs.tables import message_from_table, rows_from_message
from simbev_ros.scene.blueprints import load_blueprints
from simbev_ros.scene.frames import base_link_frame
from simbev_ros.schema.scene.agents import AgentView
from simbev_ros.schema.scene.lights import BuildingLightSpec
from simbev_ros.schema.scene.state import ACTOR_DTYPE, EGO_ID, SIGNAL_DTYPE, Event, WorldState
from simbev_ros.schema.scene.weather import Weather
from simbev_ros.schema.stored import read_stored

MAP_FRAME, EARTH_FRAME = "map", "earth"


def actors_message(state: WorldState) -> PointCloud2:
    """PointCloud2 message with the actors table."""
    return message_from_table(state.actors, state.stamp_ns, MAP_FRAME)


def signals_message(state: WorldState) -> PointCloud2:
    """PointCloud2 message with the traffic-lights table."""
    return message_from_table(state.signals, state.stamp_ns, MAP_FRAME)


def lights_message(table: Table, stamp_ns: int) -> PointCloud2:
    """PointCloud2 message with the street-lights table."""
    return message_from_table(table, stamp_ns, MAP_FRAME)


def building_lights_message(lights: BuildingLightSpec) -> String:
    """Message with the switch, share and colors of lit windows as JSON."""
    return String(data=lights.model_dump_json())


def weather_message(state: WorldState) -> String:
    """Message with the weather as JSON, including the stamp that a String lacks."""
    return String(data=json.dumps({"stamp_ns": state.stamp_ns, **state.weather.model_dump()}))


def record_message(record: dict[str, Any], stamp_ns: int) -> String:
    """Message with a record as JSON, including the stamp that a String lacks."""
    return String(data=json.dumps({"stamp_ns": stamp_ns, **record}))


def event_message(event: Event, state: WorldState) -> String:
    """Message with an event of this tick as JSON, including the stamp that a String lacks."""
    return String(data=json.dumps(event_record(event, state)))


def event_record(event: Event, state: WorldState) -> dict[str, Any]:
    """An event of this tick with stamp and tick."""
    fields = asdict(event)
    return {"type": fields.pop("type"), "stamp_ns": state.stamp_ns, "tick": state.tick, **fields}


def actors_from_message(message: PointCloud2) -> Table:
    """(N,) ``ACTOR_DTYPE`` from an ``actors_message``.

    Raises:
        ValueError: The message is not such a table, or an impossible one: without an ego, with ids that do not ascend,
            with unknown blueprints, or with numbers that are not finite.
    """
    actors = rows_from_message(message, ACTOR_DTYPE)
    ids = actors["id"]
    if not (ids[1:] > ids[:-1]).all() or EGO_ID not in ids:
        raise ValueError("its ids must ascend and contain the ego's")
    if not (actors["blueprint"] < len(load_blueprints())).all():
        raise ValueError("it has an unknown blueprint")
    if not all(np.isfinite(actors[name]).all() for name in _FLOATS):
        raise ValueError("it has numbers that are not finite")
    return actors


def signals_from_message(message: PointCloud2) -> Table:
    """(S,) ``SIGNAL_DTYPE`` from a ``signals_message``; raises ValueError if the message is not such a table."""
    return rows_from_message(message, SIGNAL_DTYPE)


def weather_from_message(message: String) -> tuple[int, Weather]:
    """Stamp, ns, and weather from a ``weather_message``; raises ValueError if it is none."""
    fields = parse_json(message.data)
    if not isinstance(fields, dict) or not isinstance(stamp_ns := fields.pop("stamp_ns", None), int):
        raise ValueError("it has no stamp_ns")
    return stamp_ns, read_stored(Weather, fields)


_IDENTITY_XYZW = np.array([0.0, 0.0, 0.0, 1.0])
_FLOATS = [name for name in ACTOR_DTYPE.names or () if ACTOR_DTYPE[name].kind == "f"]


class QuaternionSigns:
    """Gives the rotations of moving frames signs that do not jump where a heading passes ±180°.

    Up to tick 0 real parts are 0 or more, so that recordings and replays begin alike.
    """

    def __init__(self) -> None:
        self._latest: dict[str, Float64Array] = {}

    def keep(self, frame: str, tick: int, rotation: Quaternion) -> None:
        """Change the sign of a frame's rotation at a tick, if that is nearer to the one at the tick before."""
        xyzw = np.array([rotation.x, rotation.y, rotation.z, rotation.w])
        before = self._latest.get(frame, _IDENTITY_XYZW) if tick > 0 else _IDENTITY_XYZW
        self._latest[frame] = kept = with_signs_of(xyzw[None], before)[0]
        rotation.x, rotation.y, rotation.z, rotation.w = kept.tolist()


def agent_odometry(view: AgentView, actors: Table, stamp_ns: int) -> Odometry:
    """Odometry message with the true motion of an agent's base_link.

    Args:
        view: The agent's view of the scene.
        actors: (N,) ``ACTOR_DTYPE``, all actors at this tick.
        stamp_ns: Stamp of the tick, ns.

    Raises:
        ValueError: The agent's vehicle is not among the actors.
    """
    return odometry_message(view.ego_row(actors), stamp_ns, base_link_frame(view.agent), view.base_link_x_m)


def odometry_message(actor: Table, stamp_ns: int, child_frame: str, ahead_m: float = 0.0) -> Odometry:
    """Odometry message from one ``ACTOR_DTYPE`` row.

    The true pose is in the map frame, the twist in the child frame. The covariances are zero: the pose is exact.

    Args:
        actor: The row.
        stamp_ns: Stamp, ns.
        child_frame: Name of the frame that the message describes; its axes are the actor's.
        ahead_m: X of the frame's origin in the actor's frame.
    """
    rpy = np.array([actor["roll"], actor["pitch"], actor["yaw"]], np.float64)
    child_from_map = rotations_from_rpy(rpy).T
    message = Odometry(header=header(stamp_ns, MAP_FRAME), child_frame_id=child_frame)
    message.pose.pose.position = point_message(position_ahead(actor, ahead_m))
    message.pose.pose.orientation = quaternion_message(quaternion_from_rpy(rpy))
    velocity = child_from_map @ np.array([actor["vx"], actor["vy"], actor["vz"]], np.float64)
    rates = child_from_map @ np.array([actor["wx"], actor["wy"], actor["wz"]], np.float64)
    if ahead_m:
        velocity = velocity + np.cross(rates, [ahead_m, 0.0, 0.0])
    message.twist.twist.linear = vector_message(velocity)
    message.twist.twist.angular = vector_message(rates)
    return message


def position_ahead(actor: Table, ahead_m: float) -> Float64Array:
    """(3,) position, map frame, of a point on the x axis of the frame of an actor, one ``ACTOR_DTYPE`` row."""
    position_m = np.array([actor["x"], actor["y"], actor["z"]], np.float64)
    if not ahead_m:
        return position_m
    rpy_rad = np.array([actor["roll"], actor["pitch"], actor["yaw"]], np.float64)
    return np.asarray(position_m + ahead_m * rotations_from_rpy(rpy_rad)[:, 0], np.float64)


def map_from_base_link(odometry: Odometry) -> Float64Array:
    """(4, 4) pose from an ``odometry_message``: map from its child frame, base_link."""
    position, orientation = odometry.pose.pose.position, odometry.pose.pose.orientation
    return matrices_from_xyz_quaternion(
        np.array([position.x, position.y, position.z]),
        np.array([orientation.x, orientation.y, orientation.z, orientation.w]),
    )


def quaternion_message(xyzw: Float64Array) -> Quaternion:
    """Quaternion message from (4,) x y z w."""
    return Quaternion(x=float(xyzw[0]), y=float(xyzw[1]), z=float(xyzw[2]), w=float(xyzw[3]))


def point_message(xyz: Float64Array) -> Point:
    """Point message from (3,)."""
    return Point(x=float(xyz[0]), y=float(xyz[1]), z=float(xyz[2]))


def vector_message(xyz: Float64Array) -> Vector3:
    """Vector3 message from (3,)."""
    return Vector3(x=float(xyz[0]), y=float(xyz[1]), z=float(xyz[2]))
