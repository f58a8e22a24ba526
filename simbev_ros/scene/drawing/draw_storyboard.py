"""Cast the entities of a scenario: its file and a map in; models, and the start of the first agent, out."""

import logging
import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from simbev_ros.config.places import SpawnPose
from simbev_ros.config.scenario import Scenario
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.geometry.geodesy import MapDatum
from simbev_ros.foundation.random import stream
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.scene.blueprints import Blueprint, blueprint_named, load_blueprints
from simbev_ros.scene.storyboard.bodies import Body, Pose, body_of, mover_on
from simbev_ros.scene.storyboard.distributions import variations
from simbev_ros.scene.storyboard.environment import weather_of
from simbev_ros.scene.storyboard.model import Element, elements_in
from simbev_ros.scene.storyboard.positions import Positions
from simbev_ros.scene.storyboard.reading import read_resolved, resolve
from simbev_ros.schema.scene.storyboard_spec import CastSpec, StoryboardSpec

_LOGGER = logging.getLogger(__name__)
_OFF_LANE_M, _FAR_M, _MAX_NAMES = 5.0, 40.0, 20
_EGO_NAMES = ("ego", "hero", "ego_vehicle", "egovehicle")
_PREFIXES: Mapping[str, tuple[str, ...]] = {
    "car": ("car",),
    "van": ("truck", "car"),
    "truck": ("truck",),
    "trailer": ("truck",),
    "semitrailer": ("truck",),
    "bus": ("bus",),
    "motorbike": ("motorcycle",),
    "bicycle": ("bicycle",),
    "train": ("bus",),
    "tram": ("bus",),
    "pedestrian": ("pedestrian",),
    "wheelchair": ("pedestrian",),
    "animal": ("pedestrian",),
    "barrier": ("barrier",),
    "railing": ("barrier",),
}
"""Classes of boxes from which entities of a category are played; other objects are cones or barriers."""
_ROLES = {"police": "police", "ambulance": "ambulance", "fire": "fire_engine"}


def blueprint_of(body: Element) -> Blueprint:
    """The model of the same category whose size is closest to that of a vehicle, pedestrian or object."""
    category = getattr(
        body, {"Vehicle": "vehicle_category", "Pedestrian": "pedestrian_category"}.get(body.kind, ""), ""
    )
    category = category or body.misc_object_category
    classes = _PREFIXES.get(category, ("traffic_cone", "barrier"))
    size_m = body.bounding_box.dimensions
    wanted_m = np.array([size_m.length_m, size_m.width_m, size_m.height_m])
    kind = {"Vehicle": "vehicle", "Pedestrian": "pedestrian"}.get(body.kind, "prop")
    choice = [each for each in load_blueprints() if each.kind == kind and each.box_class in classes and not each.tows]
    role = _ROLES.get(getattr(body, "role", "none"))
    if kind == "vehicle":
        suited = [
            each for each in choice if (role is not None and role in each.name) or (role is None and not each.emergency)
        ]
        choice = suited or choice
    elif kind == "pedestrian":  # boxes of people include their longest stride
        choice = [each for each in choice if each.frequency and each.wheelchair == (category == "wheelchair")]
        wanted_m[:2] = 0.0
    weight = np.array([kind != "pedestrian", kind != "pedestrian", True])
    return min(choice, key=lambda each: float(np.abs((np.array(each.size_m) - wanted_m) * weight).sum()))


def ego_of(scenario: Element) -> Element:
    """The entity that is the first agent's vehicle: by its name, a property or its controller, else the first vehicle.

    Raises:
        InputError: There is no vehicle.
    """
    vehicles = [each for each in scenario.entities if each.body.kind == "Vehicle"]
    if not vehicles:
        raise InputError(f"{scenario.origin}: it has no vehicle that could be the first agent's")

    def says_ego(entity: Element) -> bool:
        return any(each.kind == "Property" and each.value.casefold() in _EGO_NAMES for each in elements_in(entity))

    named = [each for each in vehicles if each.name.casefold() in _EGO_NAMES]
    return next(iter([*named, *filter(says_ego, vehicles), *vehicles]))


def cast_scenario(config: Scenario, file: Path, number: int, network: RoadNetwork) -> tuple[Scenario, StoryboardSpec]:
    """Cast the entities of a scenario.

    Args:
        config: The configuration.
        file: The OpenSCENARIO file, or one with values for its parameters.
        number: Number of the scene, which has one of these variations after the other.
        network: Roads of its map.

    Returns:
        The configuration with the first agent's vehicle and start, and the specification of the storyboard.

    Raises:
        InputError: The file cannot be used, or has no vehicle.
    """
    found = variations(file, stream(config.seed, "scenario"))
    resolved = resolve(found[number % len(found)].path, found[number % len(found)].values)
    scenario = resolved.scenario
    ego = ego_of(scenario)
    entities = [ego, *(each for each in scenario.entities if each is not ego)]
    cast = [CastSpec(name=each.name, blueprint=blueprint_of(each.body).name) for each in entities]
    for entity, member in zip(entities, cast, strict=True):
        own_m, asked = blueprint_named(member.blueprint).size_m, entity.body.bounding_box.dimensions
        _LOGGER.info(
            "%s: %s (%.2f x %.2f x %.2f m) is played by %s (%.2f x %.2f x %.2f m)",
            *(file.name, entity.name, asked.length_m, asked.width_m, asked.height_m, member.blueprint, *own_m),
        )
    for note in resolved.notes:
        _LOGGER.info("%s: %s", file.name, note)
    start, *route = _route_of(config, file.name, scenario, ego, network)
    vehicle = config.ego.model_copy(update={"blueprint": cast[0].blueprint, "spawn": (start,), "route": ()})
    drive = config.drive
    if drive is not None and (not route or config.ego.driver == "traffic"):
        reason = "it assigns no route to the first agent" if not route else "the scenario itself drives the first agent"
        _LOGGER.warning("%s: the drive is not scored: %s", file.name, reason)
        drive = None
    elif drive is not None:
        drive = drive.model_copy(update={"route": (start, *route), "events": None})
    spec = StoryboardSpec(document=resolved.document, cast=tuple(cast))
    return config.model_copy(update={"ego": vehicle, "drive": drive}), spec


def first_weather(storyboard: StoryboardSpec, datum: MapDatum) -> dict[str, float]:
    """Parameters of the weather that the scenario sets in ``Init``."""
    actions = read_resolved(storyboard.document).storyboard.init.global_actions
    environments = [action.environment for action in actions if action.kind == "EnvironmentAction"]
    return {name: value for each in environments for name, value in weather_of(each, datum).items()}


def entity_starts_m(storyboard: StoryboardSpec, network: RoadNetwork) -> dict[str, Float64Array]:
    """(2,) position, map frame, of each entity besides the first agent that ``Init`` puts anywhere, by name."""
    bodies, _ = _enter_bodies(read_resolved(storyboard.document), network)
    others = [bodies[each.name] for each in storyboard.cast[1:]]
    return {body.name: body.position_m[:2] for body in others if body.is_present}


def _enter_bodies(scenario: Element, network: RoadNetwork) -> tuple[dict[str, Body], Positions]:
    """The bodies of all entities by name, after ``Init``, and what resolves positions."""
    bodies = {each.name: body_of(each, blueprint_of(each.body)) for each in scenario.entities}
    positions = Positions(mover_on(network), bodies, network.datum, network.origin_m)
    positions.enter(scenario.storyboard.init)
    return bodies, positions


def _route_of(config: Scenario, file: str, scenario: Element, ego: Element, network: RoadNetwork) -> list[SpawnPose]:
    """Poses on lanes: the start of the first agent after ``Init``, and the route or position that it is given first."""
    (bodies, positions), init = _enter_bodies(scenario, network), scenario.storyboard.init
    positions.check(scenario)
    body = bodies[ego.name]
    if not body.is_present:
        raise InputError(f"{ego.origin}: no TeleportAction in <Init> puts {ego.name}, the first agent, anywhere")
    _tell_misfits(file, scenario, [each for each in bodies.values() if each.is_present], network)
    if config.ego.driver != "traffic":
        words = "%s: %s is driven from outside (%s): it starts from rest in the middle of the nearest lane"
        _LOGGER.info(words, file, ego.name, config.ego.driver)
    own = [action for each in init.privates if each.entity_ref == ego.name for action in each.actions]
    groups = [group for story in scenario.storyboard.stories for act in story.acts for group in act.maneuver_groups]
    acting = [group for group in groups if ego.name in {each.entity_ref for each in group.actors.entities}]
    given = [each for group in acting for each in elements_in(group)]
    routed = next(
        (each for each in (*own, *given) if each.kind in ("AssignRouteAction", "AcquirePositionAction")), None
    )
    goals: list[Element] = []
    if routed is not None:
        is_route = routed.kind == "AssignRouteAction"
        goals = [each.position for each in routed.route.waypoints] if is_route else [routed.position]
    poses = [Pose(body.position_m, body.yaw_rad), *map(positions.pose, goals)]
    at_m = np.array([np.nan_to_num(pose.position_m) for pose in poses])
    lanes = network.nearest_lane(at_m, np.array([pose.yaw_rad for pose in poses]))
    return [
        SpawnPose(x_m=x_m, y_m=y_m, z_m=z_m, yaw_deg=math.degrees(math.remainder(yaw_rad, math.tau)))
        for (x_m, y_m, z_m), yaw_rad in zip(lanes.position_m.tolist(), lanes.yaw_rad.tolist(), strict=True)
    ]


def _tell_misfits(file: str, scenario: Element, bodies: Sequence[Body], network: RoadNetwork) -> None:
    """Log which entities are far from any lane, and which signals the map does not have."""
    at_m = np.nan_to_num(np.array([body.position_m for body in bodies]))
    lanes = network.nearest_lane(at_m, np.array([body.yaw_rad for body in bodies]))
    for body, off_m in zip(bodies, np.hypot(*(lanes.position_m - at_m)[:, :2].T).tolist(), strict=True):
        if off_m > (_OFF_LANE_M if body.kind == "vehicle" else _FAR_M):
            _LOGGER.warning("%s: %s is put %.0f m from the nearest lane", file, body.name, off_m)
    heads = {head.opendrive_id for head in network.signals}
    tests = ("TrafficSignalStateAction", "TrafficSignalCondition")
    names = [each.name for each in elements_in(scenario.storyboard) if each.kind in tests]
    controllers = scenario.road_network.signal_controllers
    names += [state.traffic_signal_id for each in controllers for phase in each.phases for state in phase.states]
    if unknown := [name for name in dict.fromkeys(names) if name not in heads]:
        _LOGGER.warning("%s: the map has no signals %s", file, ", ".join(unknown[:_MAX_NAMES]))
