"""The cast of a scene: the constant columns of the actors table, and how each body hangs on one of SUMO's points.

Ids: the ego is 1, then the other vehicles in the specification's order, the riders and the towed units in the order of
their vehicles, the pedestrians, the props of hazard areas, the parked vehicles, and the people who rest. The id of an
actor that cannot be placed is not reused. Rows ascend by id.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from simbev_ros.foundation.random import stream
from simbev_ros.foundation.types import BoolArray, Float64Array, Table
from simbev_ros.scene.blueprints import Blueprint, blueprint_index, blueprint_named
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import ACTOR_DTYPE, EGO_ID, Behavior
from simbev_ros.simulation.world.kinematics.contacts import BodyBoxes
from simbev_ros.simulation.world.kinematics.footing import ContactPoints
from simbev_ros.simulation.world.kinematics.motion import Bodies
from simbev_ros.simulation.world.kinematics.towing import Towing

_PEDESTRIAN_TRAIL_M = 0.75
_TRACK = 0.78  # track of cars and trucks divided by their width, mirrors included


@dataclass(frozen=True, slots=True)
class Cast:
    """The N actors of a scene: V vehicles, then riders, then T towed units, then P pedestrians.

    A rider shares its vehicle's leading point; that of a towed unit is its hitch.

    Attributes:
        rows: (N,) ``ACTOR_DTYPE`` with the constant columns filled in.
        bodies: How the bodies hang on the V + T + P leading points.
        wheelbase_m: (N,) 0 for actors without wheels that steer.
        wheel_radius_m: (N,) infinite for actors without wheels.
        stride_m: (N,) distance per turn of ``gait``; infinite if there is none or if it depends on the speed.
        tall_m: (N,) height that strides depend on.
        on_foot: (N,) whether the actor walks or runs, with strides that depend on the speed.
    """

    rows: Table
    bodies: Bodies
    wheelbase_m: Float64Array
    wheel_radius_m: Float64Array
    stride_m: Float64Array
    tall_m: Float64Array
    on_foot: BoolArray


class _Member(NamedTuple):
    """One actor; ``point`` is the index of its leading point, ``leader`` that of the vehicle that tows it."""

    id: int
    blueprint: Blueprint
    color: int
    point: int
    parent: int = 0
    behavior: Behavior = Behavior(0)
    mount_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    leader: int = 0


def cast_of(spec: SceneSpec, vehicles: Sequence[int], pedestrians: Sequence[int]) -> Cast:
    """Assemble the cast of a scene.

    Args:
        spec: The scene.
        vehicles: Indices of its vehicles that take part, ascending, in the order of their leading points.
        pedestrians: Indices of its pedestrians that take part, ascending; their points follow the vehicles'.
    """
    towed = list(_towed(spec, vehicles))
    first = len(vehicles) + len(towed)
    members = [*_vehicles(spec, vehicles), *_riders(spec, vehicles), *towed, *_pedestrians(spec, first, pedestrians)]
    blueprints = [member.blueprint for member in members]
    rows = np.zeros(len(members), ACTOR_DTYPE)
    rows["id"] = [member.id for member in members]
    rows["parent"] = [member.parent for member in members]
    rows["color"] = [member.color for member in members]
    rows["blueprint"] = [blueprint_index()[blueprint.name] for blueprint in blueprints]
    rows["tag"] = [blueprint.tag for blueprint in blueprints]
    rows["length"], rows["width"], rows["height"] = np.array([blueprint.size_m for blueprint in blueprints]).T
    rows["behavior"] = [member.behavior for member in members]
    return Cast(
        rows=rows,
        bodies=_bodies(members),
        wheelbase_m=np.array([blueprint.wheelbase_m * (blueprint.kind != "trailer") for blueprint in blueprints]),
        wheel_radius_m=np.array([blueprint.wheel_radius_m or np.inf for blueprint in blueprints]),
        stride_m=np.array([blueprint.stride_m or np.inf for blueprint in blueprints]),
        tall_m=np.array([blueprint.tall_m for blueprint in blueprints]),
        on_foot=np.array([blueprint.on_foot for blueprint in blueprints]),
    )


def first_prop_id(spec: SceneSpec) -> int:
    """The first id after vehicles, riders, towed units and pedestrians."""
    return _first_pedestrian_id(spec) + len(spec.pedestrians)


def actor_ids(spec: SceneSpec, vehicles: Iterable[int], pedestrians: Iterable[int]) -> tuple[int, ...]:
    """Ids, ascending, of vehicles and pedestrians given by their indices in the specification."""
    first = _first_pedestrian_id(spec)
    return (*sorted(EGO_ID + index for index in vehicles), *sorted(first + index for index in pedestrians))


def _first_pedestrian_id(spec: SceneSpec) -> int:
    return EGO_ID + len(spec.vehicles) + len(_mounted(spec)) + len(_towing(spec))


def _vehicles(spec: SceneSpec, indices: Sequence[int]) -> Iterator[_Member]:
    for point, index in enumerate(indices):
        vehicle = spec.vehicles[index]
        blueprint = blueprint_named(vehicle.blueprint)
        behavior = Behavior.RECKLESS * vehicle.reckless | Behavior.DISTRACTED * vehicle.distracted
        yield _Member(EGO_ID + index, blueprint, vehicle.color, point, behavior=Behavior(behavior))


def _riders(spec: SceneSpec, vehicles: Sequence[int]) -> Iterator[_Member]:
    """The riders of the participating vehicles; draws the colors of their clothes."""
    point_of = {index: point for point, index in enumerate(vehicles)}
    for number, index in enumerate(_mounted(spec)):
        if index in point_of:
            vehicle_blueprint = blueprint_named(spec.vehicles[index].blueprint)
            blueprint = blueprint_named(vehicle_blueprint.rider)
            color = blueprint.colors[int(stream(spec.seed, f"vehicles.{index}.rider").integers(len(blueprint.colors)))]
            rider = EGO_ID + len(spec.vehicles) + number
            yield _Member(
                rider, blueprint, color, point_of[index], EGO_ID + index, mount_m=vehicle_blueprint.rider_seat_m
            )


def _towed(spec: SceneSpec, vehicles: Sequence[int]) -> Iterator[_Member]:
    """What the participating vehicles tow, in the color of its vehicle if there is such a paint."""
    point_of = {index: point for point, index in enumerate(vehicles)}
    towing = _towing(spec)
    taking_part = [index for index in towing if index in point_of]
    for point, index in enumerate(taking_part, start=len(vehicles)):
        blueprint, color = (
            blueprint_named(blueprint_named(spec.vehicles[index].blueprint).tows),
            spec.vehicles[index].color,
        )
        if color not in blueprint.colors:
            rng = stream(spec.seed, f"vehicles.{index}.trailer")
            color = blueprint.colors[int(rng.integers(len(blueprint.colors)))]
        unit = EGO_ID + len(spec.vehicles) + len(_mounted(spec)) + towing.index(index)
        yield _Member(unit, blueprint, color, point, leader=point_of[index])


def _pedestrians(spec: SceneSpec, first_point: int, indices: Sequence[int]) -> Iterator[_Member]:
    first = _first_pedestrian_id(spec)
    for number, index in enumerate(indices):
        pedestrian = spec.pedestrians[index]
        yield _Member(first + index, blueprint_named(pedestrian.blueprint), pedestrian.color, first_point + number)


def _mounted(spec: SceneSpec) -> list[int]:
    """Indices of the vehicles that have a rider."""
    return [index for index, vehicle in enumerate(spec.vehicles) if blueprint_named(vehicle.blueprint).rider]


def _towing(spec: SceneSpec) -> list[int]:
    """Indices of the vehicles that tow something; those in hazard areas have been unhitched."""
    return [
        index
        for index, vehicle in enumerate(spec.vehicles)
        if vehicle.stands_at is None and blueprint_named(vehicle.blueprint).tows
    ]


def _bodies(members: Sequence[_Member]) -> Bodies:
    """Bodies of the members: axles half a wheelbase from a vehicle's center, leading point near the front axle."""
    point_owners = sorted((member for member in members if not member.parent), key=lambda member: member.point)
    is_vehicle = np.array([member.blueprint.kind in ("vehicle", "trailer") for member in point_owners])
    towed = [member for member in point_owners if member.blueprint.kind == "trailer"]
    vehicles = [point_owners[member.leader].blueprint for member in towed]
    rear_m = np.where(is_vehicle, [member.blueprint.footprint.axle_m for member in point_owners], _PEDESTRIAN_TRAIL_M)
    lead_m = np.where(is_vehicle, [member.blueprint.footprint.lead_m for member in point_owners], 0.0)
    return Bodies(
        point=np.array([member.point for member in members], np.int64),
        trail_m=lead_m + rear_m,
        lead_m=lead_m,
        leans=np.array([bool(member.blueprint.rider) for member in point_owners]),
        mount_m=np.array([member.mount_m for member in members], np.float64),
        contacts=_contacts([member.blueprint for member in point_owners]),
        boxes=BodyBoxes(
            np.array([member.blueprint.size_m for member in point_owners]), int(np.count_nonzero(is_vehicle))
        ),
        towing=Towing(
            np.array([member.leader for member in towed], np.int64),
            np.array([each.footprint.lead_m - each.hitch_m for each in vehicles]),
            np.array([member.blueprint.hitch_m + member.blueprint.axle_m for member in towed]),
        ),
    )


def _contacts(blueprints: Sequence[Blueprint]) -> ContactPoints:
    """Contact points: four wheels of a car or truck, two of a two-wheeler, the center of a pedestrian."""
    body, ahead_m, left_m = [], [], []
    for index, blueprint in enumerate(blueprints):
        arm_m = max(blueprint.wheelbase_m, 2.0 * blueprint.axle_m)  # a trailer leans on its axle and on its hitch
        track_m = 0.0 if blueprint.rider or not arm_m else _TRACK * blueprint.size_m[1]
        for ahead in (0.5, -0.5) if arm_m else (0.0,):
            for left in (0.5, -0.5) if track_m else (0.0,):
                body.append(index)
                ahead_m.append(ahead * arm_m)
                left_m.append(left * track_m)
    return ContactPoints(np.array(body, np.int64), np.array(ahead_m, np.float64), np.array(left_m, np.float64))
