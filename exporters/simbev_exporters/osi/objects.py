"""Actors of a tick as OSI's moving and stationary objects.

Rows of /world/actors enter; messages leave. Their positions are centers of boxes in the map frame, and their angles are
those of ROS (REP-103), which are OSI's (ISO 8855) too. A box contains mirrors; a vehicle's does not contain its rider,
who is a pedestrian and the vehicle's driver.
"""

from collections.abc import Iterable, Sequence
from fnmatch import fnmatchcase
from functools import lru_cache
from typing import Any

import numpy as np
from osi3.osi_common_pb2 import BaseMoving, BaseStationary
from osi3.osi_object_pb2 import MovingObject, StationaryObject

from simbev_ros.dataset import columns
from simbev_ros.foundation.tables import load_table
from simbev_ros.foundation.types import Float64Array, Table
from simbev_ros.scene.blueprints import Blueprint, blueprint_index, blueprint_named
from simbev_ros.schema.boxes import box_centers_m
from simbev_ros.schema.scene.state import Light, map_from_actors

Names = Sequence[str]
"""OSI's type, vehicle type and role of a moving object; of others the type alone."""

_Lights = MovingObject.VehicleClassification.LightState


class ActorMessages:
    """Messages of a scene's actors.

    Args:
        blueprints: The scene's blueprints, /world/legend.
    """

    def __init__(self, blueprints: Iterable[dict[str, Any]]) -> None:
        self._kinds = [(str(each["name"]), str(each["class"])) for each in blueprints]

    def moving(self, actors: Table) -> list[MovingObject]:
        """Vehicles, riders and pedestrians among (N,) ``ACTOR_DTYPE`` actors, in their order."""
        riders = {int(row["parent"]): int(row["id"]) for row in actors if row["parent"]}
        found = []
        for row, motion in zip(actors, _motions(actors), strict=True):
            name, box_class = self._kinds[row["blueprint"]]
            names = moving_names(name, box_class)
            if names:
                message = MovingObject(base=motion, type=_value(MovingObject, "TYPE", names[0]), model_reference=name)
                message.id.value = int(row["id"])
                if len(names) > 1:
                    _describe_vehicle(message, row, names, name, riders.get(int(row["id"])))
                found.append(message)
        return found

    def stationary(self, actors: Table) -> list[StationaryObject]:
        """Cones and barriers among (N,) ``ACTOR_DTYPE`` actors."""
        known, kinds = osi_names()["stationary"], StationaryObject.Classification
        found = []
        for row, center_m in zip(actors, box_centers_m(actors), strict=True):
            name = self._kinds[row["blueprint"]][0]
            if name in known:
                size_m = [float(row[size]) for size in ("length", "width", "height")]
                angles = [float(row[angle]) for angle in ("roll", "pitch", "yaw")]
                message = StationaryObject(base=base_stationary(center_m, size_m, angles), model_reference=name)
                message.id.value = int(row["id"])
                message.classification.type = _value(kinds, "TYPE", known[name][0])
                message.classification.material = _value(kinds, "MATERIAL", known[name][1])
                found.append(message)
        return found


def base_stationary(center_m: Float64Array, size_m: Sequence[float], rpy_rad: Sequence[float]) -> BaseStationary:
    """The box of a stationary object: its center in the map frame, its length, width and height, and its angles."""
    base = BaseStationary()
    base.position.x, base.position.y, base.position.z = map(float, center_m)
    base.dimension.length, base.dimension.width, base.dimension.height = size_m
    base.orientation.roll, base.orientation.pitch, base.orientation.yaw = rpy_rad
    return base


def moving_names(blueprint: str, box_class: str) -> Names:
    """OSI's names of the actors of a blueprint with a class of boxes; none if they do not move."""
    return _moving_names(blueprint, box_class)


@lru_cache(maxsize=1024)
def _moving_names(blueprint: str, box_class: str) -> Names:
    patterns = osi_names()["moving"].items()
    found = next((names for pattern, names in patterns if fnmatchcase(blueprint, pattern)), None)
    is_prop = blueprint.startswith("prop.")
    return tuple(found or ([] if is_prop else osi_names()["moving_classes"].get(box_class, ["OTHER"])))


@lru_cache(maxsize=1)
def osi_names() -> dict[str, Any]:
    """The tables of names.yaml."""
    return load_table("simbev_exporters.osi", "names.yaml")


def _motions(actors: Table) -> list[BaseMoving]:
    """Boxes and motion of actors. Accelerations are those of the middle of the bottom face, as recorded."""
    pose, centers_m = map_from_actors(actors), box_centers_m(actors)
    rates = columns(actors, "wx", "wy", "wz").astype(np.float64)
    arms_m = centers_m - columns(actors, "x", "y", "z")
    velocities_mps = columns(actors, "vx", "vy", "vz") + np.cross(rates, arms_m)
    euler_rates = _euler_rates(actors, np.einsum("nji,nj->ni", pose[:, :3, :3], rates))
    found = []
    for row, center_m, velocity_mps, rate in zip(actors, centers_m, velocities_mps, euler_rates, strict=True):
        base = BaseMoving()
        base.position.x, base.position.y, base.position.z = center_m.tolist()
        base.dimension.length, base.dimension.width = float(row["length"]), float(row["width"])
        base.dimension.height = float(row["height"])
        base.orientation.roll, base.orientation.pitch = float(row["roll"]), float(row["pitch"])
        base.orientation.yaw = float(row["yaw"])
        base.velocity.x, base.velocity.y, base.velocity.z = velocity_mps.tolist()
        base.acceleration.x, base.acceleration.y = float(row["ax"]), float(row["ay"])
        base.acceleration.z = float(row["az"])
        base.orientation_rate.roll, base.orientation_rate.pitch, base.orientation_rate.yaw = rate.tolist()
        found.append(base)
    return found


def _euler_rates(actors: Table, body_rates: Float64Array) -> Float64Array:
    """(N, 3) derivatives of roll, pitch and yaw, from (N, 3) angular velocities along the actors' own axes.

    Diebel: Representing attitude: Euler angles, unit quaternions, and rotation vectors, 2006, equation 79.
    """
    roll, pitch = actors["roll"].astype(np.float64), actors["pitch"].astype(np.float64)
    p, q, r = body_rates.T
    yaw_rate = (q * np.sin(roll) + r * np.cos(roll)) / np.cos(pitch)
    return np.stack([p + np.sin(pitch) * yaw_rate, q * np.cos(roll) - r * np.sin(roll), yaw_rate], axis=1)


def _describe_vehicle(message: MovingObject, row: np.void, names: Names, blueprint: str, rider: int | None) -> None:
    kinds, attributes = MovingObject.VehicleClassification, message.vehicle_attributes
    message.vehicle_classification.type = _value(kinds, "TYPE", names[1])
    message.vehicle_classification.role = _value(kinds, "ROLE", names[2])
    attributes.SetInParent()  # vehicles must have some
    if rider is not None:
        attributes.driver_id.value = rider
    if blueprint in blueprint_index():
        _describe_axles(attributes, blueprint_named(blueprint))
    _describe_lights(message.vehicle_classification.light_state, int(row["lights"]))


def _describe_axles(attributes: Any, blueprint: Blueprint) -> None:
    """Axles, about the center of the box; of trailers the rear one alone."""
    if not blueprint.wheel_radius_m:
        return
    below_m = blueprint.wheel_radius_m - blueprint.size_m[2] / 2.0
    attributes.radius_wheel = blueprint.wheel_radius_m
    rear, front = attributes.bbcenter_to_rear, attributes.bbcenter_to_front
    rear.x, rear.y, rear.z = -blueprint.footprint.axle_m, 0.0, below_m
    if blueprint.kind == "vehicle":
        front.x, front.y, front.z = blueprint.wheelbase_m / 2.0, 0.0, below_m


def _describe_lights(state: Any, lights: int) -> None:
    """Lamps as they are at the tick: one that flashes is off half of the time."""
    indicators = bool(lights & Light.TURN_LEFT), bool(lights & Light.TURN_RIGHT)
    sides = {(False, False): "OFF", (True, False): "LEFT", (False, True): "RIGHT", (True, True): "WARNING"}
    state.indicator_state = _value(_Lights, "INDICATOR_STATE", sides[indicators])
    state.brake_light_state = _value(_Lights, "BRAKE_LIGHT_STATE", "NORMAL" if lights & Light.BRAKE else "OFF")
    for field, flag, lit in (
        ("head_light", Light.LOW_BEAM, "ON"),
        ("tail_light", Light.LOW_BEAM, "ON"),
        ("high_beam", Light.HIGH_BEAM, "ON"),
        ("reversing_light", Light.REVERSE, "ON"),
        ("emergency_vehicle_illumination", Light.EMERGENCY, "FLASHING_BLUE"),
    ):
        setattr(state, field, _value(_Lights, "GENERIC_LIGHT_STATE", lit if lights & flag else "OFF"))


def _value(kinds: Any, prefix: str, name: str) -> Any:
    """Value of an enumeration of a message."""
    return getattr(kinds, f"{prefix}_{name}")
