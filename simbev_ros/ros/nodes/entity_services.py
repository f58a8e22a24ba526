"""Services of simulation_interfaces that ask for and change the entities of the running scene.

A call acts at the start of the scene's next tick, as the node handles calls between ticks.
"""

import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from importlib import import_module
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from std_srvs.srv import Trigger

from simbev_ros.foundation.errors import SimbevError
from simbev_ros.foundation.latest_value import LatestValue
from simbev_ros.foundation.types import Float64Array, Table
from simbev_ros.ros.conventions.simulation_interfaces import (
    DELETE_SPAWNED,
    Refused,
    answering,
    refused_result,
    service_name,
    tags_match,
)
from simbev_ros.ros.msgs.entity_messages import (
    box_message,
    matrix_of_pose,
    name_pattern,
    overlapping,
    size_message,
    state_message,
    vectors_of,
)
from simbev_ros.ros.msgs.world import MAP_FRAME, point_message, position_ahead, quaternion_message
from simbev_ros.ros.nodes.entity_book import CATEGORIES, STATIC_OBJECT, EntityBook, EntityFacts, describe_model
from simbev_ros.ros.nodes.world_conditions import RunningScene
from simbev_ros.scene.blueprints import Blueprint, load_blueprints
from simbev_ros.scene.frames import base_link_frame
from simbev_ros.scene.named_poses import NamedPose, map_extent_m, named_poses
from simbev_ros.schema.scene.agents import agent_views
from simbev_ros.schema.scene.map_spec import MapSpec
from simbev_ros.schema.scene.state import map_from_actors
from simbev_ros.simulation.world.entities import MAX_ENTITIES, Entities, EntityMotion
from simbev_ros.simulation.world.source import StateSource

_NAME = re.compile(r"[A-Za-z][\w.-]{0,63}", re.ASCII)
_NAMESPACE = re.compile(r"/?[A-Za-z_]\w{0,31}(/[A-Za-z_]\w{0,31}){0,3}", re.ASCII)
_WORLD_FRAMES = ("", "world", MAP_FRAME)
_FILE = re.compile(r"\.(sdf|urdf|xacro|usd[acz]?|mjcf|xml|gltf|glb|obj|fbx)$", re.IGNORECASE)


class EntityServices:
    """Answers the calls.

    Args:
        node: The world node.
        running: Returns the scene that runs; None: none does.
    """

    def __init__(self, node: Any, running: Callable[[], RunningScene | None]) -> None:
        self._running, self._log = running, node.get_logger()
        self._books = WeakKeyDictionary[StateSource, EntityBook]()
        self._named_poses = LatestValue[MapSpec, tuple[dict[str, NamedPose], tuple[Float64Array, Float64Array]]]()
        self._types, self._messages = (import_module(f"simulation_interfaces.{kind}") for kind in ("srv", "msg"))
        for kind, act in {
            "GetEntities": self._get_entities,
            "GetEntitiesStates": self._get_states,
            "GetEntityInfo": self._get_info,
            "GetEntityState": self._get_state,
            "GetEntityBounds": self._get_bounds,
            "GetSpawnables": self._get_spawnables,
            "GetNamedPoses": self._get_poses,
            "GetNamedPoseBounds": self._get_pose_bounds,
            "SpawnEntity": self._spawn,
            "SpawnEntities": self._spawn_all,
            "DeleteEntity": self._delete,
            "SetEntityState": self._set_state,
            "SetEntityInfo": self._set_info,
        }.items():
            node.create_service(getattr(self._types, kind), service_name(kind), answering(act))
        node.create_service(Trigger, DELETE_SPAWNED, self._delete_spawned)

    # reading

    def _get_entities(self, request: Any, response: Any) -> None:
        response.entities = [name for name, _ in self._filtered(request.filters)]

    def _get_states(self, request: Any, response: Any) -> None:
        stamp_ns = self._stamp_ns()
        for name, row in self._filtered(request.filters):
            response.entities.append(name)
            response.states.append(state_message(row, stamp_ns))

    def _get_info(self, request: Any, response: Any) -> None:
        facts = self._book().facts(self._row(request.entity))
        response.info.category.category = facts.category
        response.info.description, response.info.tags = facts.description, list(facts.tags)

    def _get_state(self, request: Any, response: Any) -> None:
        response.state = state_message(self._row(request.entity), self._stamp_ns())

    def _get_bounds(self, request: Any, response: Any) -> None:
        row = self._row(request.entity)
        response.bounds = size_message(*(float(row[name]) for name in ("length", "width", "height")))

    def _get_spawnables(self, request: Any, response: Any) -> None:
        for model in _spawnables().values():
            spawnable = self._messages.Spawnable(description=describe_model(model))
            spawnable.entity_resource.uri = model.name
            spawnable.spawn_bounds = size_message(*model.size_m)
            response.spawnables.append(spawnable)
        if request.sources:
            response.result.error_message = f"sources: {', '.join(request.sources[:8])}: unknown; there are none to add"

    def _get_poses(self, request: Any, response: Any) -> None:
        for pose in self._named()[0].values():
            if tags_match(pose.tags, request.tags):
                message = self._messages.NamedPose(name=pose.name, description=pose.description, tags=list(pose.tags))
                message.pose.position = point_message(pose.position_m)
                half_rad = pose.yaw_rad / 2.0
                message.pose.orientation = quaternion_message(np.array([0.0, 0.0, np.sin(half_rad), np.cos(half_rad)]))
                response.poses.append(message)

    def _get_pose_bounds(self, request: Any, response: Any) -> None:
        if (pose := self._named()[0].get(request.name)) is None:
            raise Refused("RESULT_NOT_FOUND", f"no named pose is called {request.name!r:.80}")
        response.bounds = box_message(pose.low_m, pose.high_m)

    # changing

    def _spawn(self, request: Any, response: Any) -> None:
        scene, entities = self._scene(), self._entities()
        model, prefix = _model_of(request.entity_resource), _prefix_of(request.entity_namespace)
        taken = self._book().named_rows(self._actors())
        if request.name and not _NAME.fullmatch(request.name):
            raise Refused("NAME_INVALID", f"name: {request.name!r:.80} must be letters, digits and _ . -, up to 64")
        if not request.name and not request.allow_renaming:
            raise Refused("NAME_INVALID", "name: is empty, and renaming is not allowed")
        name = f"{prefix}{request.name}"
        if request.name and name in taken and not request.allow_renaming:
            raise Refused("NAME_NOT_UNIQUE", f"name: an entity is called {name} already")
        pose = self._map_from_frame(request.initial_pose.header.frame_id) @ matrix_of_pose(request.initial_pose.pose)
        actor = entities.spawn(model, self._motion_at(pose))
        wanted = name if request.name else f"{prefix}{model.name}_{actor}"
        others = (f"{wanted}_{number}" for number in range(2, len(taken) + 3))
        response.entity_name = wanted if wanted not in taken else next(each for each in others if each not in taken)
        self._book().name_spawned(actor, response.entity_name)
        self._note(f"spawned {response.entity_name}, {model.name}, actor {actor}", scene)

    def _spawn_all(self, request: Any, response: Any) -> None:
        failed = 0
        if len(request.spawn_requests) > MAX_ENTITIES:
            raise Refused("RESULT_OPERATION_FAILED", f"spawn_requests: are more than {MAX_ENTITIES}")
        for each in request.spawn_requests:
            one, outcome = self._types.SpawnEntity.Response(), self._messages.SpawnResult()
            try:
                self._spawn(each, one)
                outcome.result.result, outcome.entity_name = outcome.result.RESULT_OK, one.entity_name
            except SimbevError as error:
                refused_result(outcome.result, one, error)
                failed += 1
            response.results.append(outcome)
        if failed:
            raise Refused("ENTITIES_SPAWN_FAILED", f"{failed} of {len(request.spawn_requests)} were not spawned")

    def _delete(self, request: Any, response: Any) -> None:
        scene, entities, actor = self._scene(), self._entities(), int(self._row(request.entity)["id"])
        if actor in self._book().agents:
            raise Refused("RESULT_OPERATION_FAILED", f"entity: {request.entity} carries an agent, which stays")
        scene.source.adopt_entity(actor, self._actors())
        entities.delete(actor)
        self._book().forget(actor)
        self._note(f"deleted {request.entity}, actor {actor}", scene)

    def _delete_spawned(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        scene = self._running()
        entities = None if scene is None else scene.source.entities
        for actor in () if entities is None else sorted(entities.spawned):
            self._entities().delete(actor)
            self._book().forget(actor)
        response.success = entities is not None
        return response

    def _set_state(self, request: Any, response: Any) -> None:
        scene, entities, row = self._scene(), self._entities(), self._row(request.entity)
        actor, state, motion = int(row["id"]), request.state, EntityMotion.of_row(row)
        if self._book().agents.get(actor, "traffic") != "traffic":
            raise Refused("RESULT_OPERATION_FAILED", f"entity: {request.entity} is moved by its driver alone")
        if actor in entities:
            motion = replace(entities.motion(actor))
        map_from_frame = self._map_from_frame(state.header.frame_id)
        if request.set_pose:
            posed = self._motion_at(map_from_frame @ matrix_of_pose(state.pose))
            motion.position_m, motion.rotation = posed.position_m, posed.rotation
        turn, moved = map_from_frame[:3, :3], list[Float64Array]()
        if request.set_twist:
            motion.velocity_mps, motion.rates_radps = given = vectors_of(state.twist, turn, "state.twist")
            moved += given
        if request.set_acceleration:
            given = vectors_of(state.acceleration, turn, "state.acceleration")
            motion.acceleration_mps2, motion.angular_radps2 = given
            moved += given
        if np.any(moved) and self._book().facts(row).category == STATIC_OBJECT:
            raise Refused("RESULT_OPERATION_FAILED", f"entity: {request.entity} is a static object, which cannot move")
        if not (request.set_pose or request.set_twist or request.set_acceleration):
            return
        scene.source.adopt_entity(actor, self._actors())
        entities.place(actor, motion)
        self._note(f"set the state of {request.entity}, actor {actor}", scene)

    def _set_info(self, request: Any, response: Any) -> None:
        info, row = request.info, self._row(request.entity)
        if (category := info.category.category) not in CATEGORIES:
            raise Refused("RESULT_OPERATION_FAILED", f"info.category: is {category}; allowed: {CATEGORIES}")
        facts = EntityFacts(category, info.description[:1000], tuple(info.tags[:100]))
        self._book().describe(int(row["id"]), facts)

    # the scene

    def _scene(self) -> RunningScene:
        if (scene := self._running()) is None:
            raise Refused("RESULT_INCORRECT_STATE", "no scene is running")
        return scene

    def _entities(self) -> Entities:
        """The entities of the scene, for changes."""
        if (entities := self._scene().source.entities) is None:
            raise Refused("RESULT_INCORRECT_STATE", "a replay shows all actors as they were recorded")
        return entities

    def _actors(self) -> Table:
        """(N,) ``ACTOR_DTYPE`` of the latest tick, with what calls have changed since."""
        scene = self._scene()
        if scene.state is None:
            raise Refused("RESULT_INCORRECT_STATE", "the scene has not computed a tick yet")
        entities = scene.source.entities
        return scene.state.actors if entities is None else entities.overlay(scene.state.actors)

    def _stamp_ns(self) -> int:
        self._actors()
        state = self._scene().state
        return 0 if state is None else state.stamp_ns

    def _book(self) -> EntityBook:
        scene = self._scene()
        if scene.source not in self._books:
            self._books[scene.source] = EntityBook(agent_views(scene.spec))
        return self._books[scene.source]

    def _named(self) -> tuple[dict[str, NamedPose], tuple[Float64Array, Float64Array]]:
        """The named poses of the map, and its extent."""
        scene = self._scene()
        return self._named_poses.get(scene.spec.map, lambda: (named_poses(scene.network), map_extent_m(scene.network)))

    def _row(self, name: str) -> Table:
        """The row of an entity."""
        if (row := self._book().named_rows(self._actors()).get(name)) is None:
            raise Refused("RESULT_NOT_FOUND", f"no entity is called {name!r:.80}")
        return row

    def _filtered(self, filters: Any) -> Iterator[tuple[str, Table]]:
        """Names and rows of the entities that pass all filters."""
        book, named = self._book(), self._book().named_rows(self._actors())
        pattern, categories = name_pattern(filters.filter), [each.category for each in filters.categories]
        chosen = [
            (name, row)
            for name, row in named.items()
            if pattern.search(name)
            and (not categories or book.facts(row).category in categories)
            and tags_match(book.facts(row).tags, filters.tags)
        ]
        rows = np.array([row for _, row in chosen], self._actors().dtype)
        yield from (each for each, inside in zip(chosen, overlapping(rows, filters.bounds), strict=True) if inside)

    def _map_from_frame(self, frame: str) -> Float64Array:
        """(4, 4) transform from a frame: the world's, an entity's, or that of an agent's base_link."""
        if frame in _WORLD_FRAMES:
            return np.eye(4)
        named = self._book().named_rows(self._actors())
        if (row := named.get(frame)) is not None:
            return map_from_actors(row)
        for view in agent_views(self._scene().spec):
            if frame == base_link_frame(view.agent):
                row = view.ego_row(self._actors())
                pose = map_from_actors(row)
                pose[:3, 3] = position_ahead(row, view.base_link_x_m)
                return pose
        known = "map, world, the name of an entity, or base_link of an agent"
        raise Refused("INVALID_POSE", f"frame_id: {frame!r:.80} is unknown; allowed: {known}")

    def _motion_at(self, pose: Float64Array) -> EntityMotion:
        """A motion at rest at a (4, 4) pose in the map, which must lie on it."""
        low_m, high_m = self._named()[1]
        x_m, y_m, z_m = pose[:3, 3]
        if not ((low_m <= pose[:2, 3]) & (pose[:2, 3] <= high_m)).all() or abs(z_m) > high_m.max() - low_m.min():
            raise Refused("INVALID_POSE", f"pose.position: {x_m:.6g}, {y_m:.6g}, {z_m:.6g} is far from the map")
        return EntityMotion(pose[:3, 3].copy(), pose[:3, :3].copy())

    def _note(self, words: str, scene: RunningScene) -> None:
        self._log.info(f"{words}, from tick {scene.next_tick} on")


def _spawnables() -> dict[str, Blueprint]:
    """Models that can be spawned, by name; riders come with their vehicles."""
    return {model.name: model for model in load_blueprints() if model.kind != "rider"}


def _model_of(resource: Any) -> Blueprint:
    """The model that a Resource names."""
    if not resource.uri and not resource.resource_string:
        raise Refused("NO_RESOURCE", "entity_resource: has neither a URI nor a string")
    if not resource.uri:
        raise Refused("RESULT_FEATURE_UNSUPPORTED", "entity_resource: strings are not supported; name a model as URI")
    if _FILE.search(resource.uri):
        raise Refused("UNSUPPORTED_FORMAT", f"entity_resource: {resource.uri!r:.80} is a file; name a model")
    if (model := _spawnables().get(resource.uri)) is None:
        raise Refused("RESULT_NOT_FOUND", f"entity_resource: no model is called {resource.uri!r:.80}")
    return model


def _prefix_of(namespace: str) -> str:
    """The prefix that a namespace gives to a name."""
    if namespace and not _NAMESPACE.fullmatch(namespace):
        raise Refused("NAMESPACE_INVALID", f"entity_namespace: {namespace!r:.80} is not a namespace of ROS")
    return f"{namespace.strip('/')}/" if namespace else ""
