"""Entity services of simulation_interfaces: filters, states, spawning, moving and deleting, and what is refused."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from made_up_scene import made_up_spec
from scene_edits import with_ego

from simbev_ros.foundation.types import Table
from simbev_ros.maps.build import load_network
from simbev_ros.ros.conventions.simulation_interfaces import service_name
from simbev_ros.ros.msgs.stamps import stamp_of
from simbev_ros.ros.nodes.world_conditions import RunningScene
from simbev_ros.scene.blueprints import blueprint_index, blueprint_named, load_blueprints
from simbev_ros.schema.scene.map_spec import MapSpec
from simbev_ros.schema.scene.state import ACTOR_DTYPE, SIGNAL_DTYPE, Behavior, WorldState
from simbev_ros.simulation.world.entities import Entities

srv = pytest.importorskip("simulation_interfaces.srv")
msg = pytest.importorskip("simulation_interfaces.msg")

from simbev_ros.ros.nodes.entity_services import EntityServices  # noqa: E402

RESULT = msg.Result
BOUNDS = msg.Bounds


def actor(number: int, name: str, x_m: float, y_m: float, **columns: float) -> Table:
    model = load_blueprints()[blueprint_index()[name]]
    row = np.zeros(1, ACTOR_DTYPE)
    row["id"], row["blueprint"], row["tag"], row["x"], row["y"] = number, blueprint_index()[name], model.tag, x_m, y_m
    row["length"], row["width"], row["height"] = model.size_m
    for column, value in columns.items():
        row[column] = value
    return row


CONE = next(model.name for model in load_blueprints() if model.kind == "prop")
WALKER = next(model.name for model in load_blueprints() if model.on_foot)


class Source:
    """A source of states with three vehicles, a prop and a pedestrian, which keeps what it is told to adopt."""

    def __init__(self) -> None:
        self.entities: Entities | None = Entities(0.05, 100)
        self.actors = np.concatenate(
            [
                actor(1, "vehicle.sedan", 0.0, 0.0, vx=5.0),
                actor(2, "vehicle.van", 30.0, 0.0, yaw=np.pi / 2.0),
                actor(3, "vehicle.sedan", 0.0, 40.0, behavior=Behavior.PARKED),
                actor(4, CONE, 10.0, 10.0),
                actor(5, WALKER, -20.0, 3.0),
            ]
        )

    def adopt_entity(self, number: int, actors: Table) -> None:
        assert self.entities is not None
        if number not in self.entities:
            self.entities.adopt(actors[actors["id"] == number], np.zeros((1, 3)))


class Scene:
    """The services of a running scene, called without ROS."""

    def __init__(self) -> None:
        self.spec, self.source = made_up_spec(()), Source()
        self.network = load_network(MapSpec(name="Blocks"))
        self.runs = True
        self._callbacks: dict[str, Callable[[Any, Any], Any]] = {}
        EntityServices(self, self._running)

    def _running(self) -> RunningScene | None:
        state = WorldState(
            self.spec.stamp_ns(3), 3, 1, self.source.actors, np.zeros(0, SIGNAL_DTYPE), self.spec.weather
        )
        return RunningScene(self.spec, self.source, 4, self.network, state) if self.runs else None  # type: ignore[arg-type]

    def get_logger(self) -> Any:
        return SimpleNamespace(info=lambda _: None)

    def create_service(self, _: Any, name: str, callback: Callable[[Any, Any], Any]) -> None:
        self._callbacks[name] = callback

    def call(self, kind: str, **fields: Any) -> Any:
        service = getattr(srv, kind)
        return self._callbacks[service_name(kind)](service.Request(**fields), service.Response())

    def ok(self, kind: str, **fields: Any) -> Any:
        response = self.call(kind, **fields)
        assert response.result.result == RESULT.RESULT_OK, response.result.error_message
        return response

    def refusal(self, kind: str, **fields: Any) -> tuple[int, str]:
        result = self.call(kind, **fields).result
        return result.result, result.error_message


@pytest.fixture
def scene() -> Scene:
    return Scene()


def resource(uri: str = "vehicle.sedan") -> Any:
    return msg.Resource(uri=uri)


def pose(x_m: float = 50.0, y_m: float = 0.0, frame: str = "", w: float = 1.0) -> Any:
    from geometry_msgs.msg import PoseStamped

    made = PoseStamped()
    made.header.frame_id = frame
    made.pose.position.x, made.pose.position.y, made.pose.orientation.w = x_m, y_m, w
    return made


def names(scene: Scene, **filters: Any) -> list[str]:
    return list(scene.ok("GetEntities", filters=msg.EntityFilters(**filters)).entities)


def test_entities_have_the_names_of_agents_and_of_their_models(scene: Scene) -> None:
    assert names(scene) == ["ego", "vehicle.van_2", "vehicle.sedan_3", f"{CONE}_4", f"{WALKER}_5"]


def test_entities_are_filtered_by_name_category_and_tags(scene: Scene) -> None:
    human, static = (msg.EntityCategory(category=number) for number in (2, 5))
    assert names(scene, filter="^vehicle.*_[[:digit:]]+$") == ["vehicle.van_2", "vehicle.sedan_3"]
    assert names(scene, categories=[human, static]) == [f"{CONE}_4", f"{WALKER}_5"]
    tags = ["vehicle", "parked"]
    assert names(scene, tags=msg.TagsFilter(tags=tags, filter_mode=1)) == ["vehicle.sedan_3"]
    assert names(scene, tags=msg.TagsFilter(tags=tags)) == ["ego", "vehicle.van_2", "vehicle.sedan_3"]
    assert names(scene, tags=msg.TagsFilter(tags=["parked"]), filter="van") == []


def bounds(kind: int, *points: tuple[float, float, float]) -> Any:
    from geometry_msgs.msg import Vector3

    return BOUNDS(type=kind, points=[Vector3(x=x, y=y, z=z) for x, y, z in points])


def test_entities_are_filtered_by_overlap(scene: Scene) -> None:
    # The van stands across x at 30 m: it reaches 1.2 m to either side along x and 2.98 m along y.
    near = bounds(BOUNDS.TYPE_SPHERE, (33.0, 0.0, 1.0), (1.9, 0.0, 0.0))
    assert names(scene, bounds=near) == ["vehicle.van_2"]
    assert names(scene, bounds=bounds(BOUNDS.TYPE_SPHERE, (33.0, 0.0, 1.0), (1.7, 0.0, 0.0))) == []
    assert names(scene, bounds=bounds(BOUNDS.TYPE_BOX, (31.0, 5.0, 2.0), (29.5, 2.9, 0.5))) == ["vehicle.van_2"]
    assert names(scene, bounds=bounds(BOUNDS.TYPE_BOX, (31.0, 5.0, 2.0), (29.5, 3.1, 0.5))) == []
    # A triangle whose bounding box overlaps the van, but which does not.
    corners = [(31.5, 0.0), (28.5, 6.5), (31.5, 6.5)]
    hull = [(x, y, z) for z in (0.0, 2.0) for x, y in corners]
    assert names(scene, bounds=bounds(BOUNDS.TYPE_CONVEX_HULL, *hull)) == ["vehicle.van_2"]
    hull = [(x + 0.5, y + 3.0, z) for x, y, z in hull]
    assert names(scene, bounds=bounds(BOUNDS.TYPE_CONVEX_HULL, *hull)) == []
    assert len(names(scene, bounds=bounds(BOUNDS.TYPE_EMPTY))) == 5


@pytest.mark.parametrize(
    ("filters", "words"),
    [
        ({"filter": "("}, "filter: is not a regular expression: missing ), unterminated subpattern at position 0"),
        ({"filter": "(a+)+$"}, "filter: has too many repetitions, or one of a group with choices"),
        ({"filter": "((a)|a)*$"}, "filter: has too many repetitions, or one of a group with choices"),
        ({"filter": "a*b*c*d?e*"}, "filter: has too many repetitions, or one of a group with choices"),
        ({"filter": "a" * 300}, "filter: is longer than 200 characters"),
        ({"bounds": bounds(1, (1.0, 1.0, 1.0))}, "filters.bounds: has 1 points; needed: 2"),
        ({"bounds": bounds(2, *[(1.0, 1.0, 1.0)] * 101)}, "filters.bounds: has more than 100 points"),
        ({"bounds": bounds(9, (1.0, 1.0, 1.0))}, "filters.bounds: has an unknown type, or points that are not finite"),
        (
            {"bounds": bounds(3, *[(np.nan, 0.0, 0.0)] * 2)},
            "filters.bounds: has an unknown type, or points that are not",
        ),
    ],
)
def test_bad_filters_are_refused(scene: Scene, filters: dict[str, Any], words: str) -> None:
    code, message = scene.refusal("GetEntities", filters=msg.EntityFilters(**filters))
    assert code == RESULT.RESULT_OPERATION_FAILED and message.startswith(words)


def test_states_are_those_of_the_table_in_the_map_frame(scene: Scene) -> None:
    state = scene.ok("GetEntityState", entity="ego").state
    assert (state.header.frame_id, stamp_of(state.header.stamp)) == ("map", scene.spec.stamp_ns(3))
    assert (state.pose.position.x, state.twist.linear.x) == (0.0, 5.0)
    van = scene.ok("GetEntityState", entity="vehicle.van_2").state
    assert van.pose.orientation.z == pytest.approx(np.sqrt(0.5), abs=1e-6)
    every = scene.ok("GetEntitiesStates")
    assert list(every.entities) == names(scene) and every.states[1] == van


def test_bounds_are_the_box_of_an_entity_in_its_frame(scene: Scene) -> None:
    found = scene.ok("GetEntityBounds", entity="vehicle.van_2").bounds
    (high, low), (length_m, width_m, height_m) = (
        found.points,
        blueprint_named("vehicle.van").size_m,
    )
    assert found.type == BOUNDS.TYPE_BOX
    assert (high.x, high.y, high.z) == pytest.approx((length_m / 2.0, width_m / 2.0, height_m))
    assert (low.x, low.y, low.z) == pytest.approx((-length_m / 2.0, -width_m / 2.0, 0.0))


def test_facts_are_those_of_the_model_until_they_are_set(scene: Scene) -> None:
    info = scene.ok("GetEntityInfo", entity="ego").info
    assert (info.category.category, list(info.tags)) == (1, ["vehicle", "car", "sedan", "agent"])
    assert info.description == "vehicle sedan, 4.73 m x 2.08 m x 1.43 m"
    changed = msg.EntityInfo(description="mine", tags=["a", "b"])
    changed.category.category = 4
    scene.ok("SetEntityInfo", entity="ego", info=changed)
    assert scene.ok("GetEntityInfo", entity="ego").info == changed
    assert names(scene, tags=msg.TagsFilter(tags=["b"])) == ["ego"]
    changed.category.category = 3
    words = "info.category: is 3; allowed: (0, 1, 2, 4, 5)"
    assert scene.refusal("SetEntityInfo", entity="ego", info=changed) == (RESULT.RESULT_OPERATION_FAILED, words)


def test_spawnables_are_all_models_but_riders(scene: Scene) -> None:
    response = scene.ok("GetSpawnables", sources=["elsewhere"])
    uris = [each.entity_resource.uri for each in response.spawnables]
    assert uris == [model.name for model in load_blueprints() if model.kind != "rider"]
    assert response.spawnables[0].spawn_bounds.type == BOUNDS.TYPE_BOX
    assert response.result.error_message == "sources: elsewhere: unknown; there are none to add"


def test_a_spawned_entity_is_there_at_once_and_can_be_moved_and_deleted(scene: Scene) -> None:
    response = scene.ok("SpawnEntity", name="box", entity_resource=resource(), initial_pose=pose(50.0, 2.0))
    assert response.entity_name == "box"
    state = scene.ok("GetEntityState", entity="box").state
    assert (state.pose.position.x, state.pose.position.y, state.twist.linear.x) == (50.0, 2.0, 0.0)
    state.pose.position.x, state.twist.linear.x = 60.0, 3.0
    scene.ok("SetEntityState", entity="box", state=state, set_twist=True)
    moved = scene.ok("GetEntityState", entity="box").state
    assert (moved.pose.position.x, moved.twist.linear.x) == (50.0, 3.0)
    scene.ok("SetEntityState", entity="box", state=state, set_pose=True)
    assert scene.ok("GetEntityState", entity="box").state.pose.position.x == 60.0
    assert "spawned" in scene.ok("GetEntityInfo", entity="box").info.tags
    scene.ok("DeleteEntity", entity="box")
    assert scene.refusal("GetEntityState", entity="box") == (RESULT.RESULT_NOT_FOUND, "no entity is called 'box'")


def test_poses_are_in_the_frame_of_an_entity_or_of_the_world(scene: Scene) -> None:
    for frame in ("", "map", "world"):
        name = scene.ok("SpawnEntity", allow_renaming=True, entity_resource=resource(), initial_pose=pose(5, 1, frame))
        assert scene.ok("GetEntityState", entity=name.entity_name).state.pose.position.x == 5.0
    beside = scene.ok("SpawnEntity", name="b", entity_resource=resource(), initial_pose=pose(5, 1, "vehicle.van_2"))
    state = scene.ok("GetEntityState", entity=beside.entity_name).state
    assert (state.pose.position.x, state.pose.position.y) == pytest.approx((29.0, 5.0), abs=1e-5)
    state.header.frame_id, state.twist.linear.x = "vehicle.van_2", 2.0
    scene.ok("SetEntityState", entity="b", state=state, set_twist=True)
    linear = scene.ok("GetEntityState", entity="b").state.twist.linear
    assert (linear.x, linear.y) == pytest.approx((0.0, 2.0), abs=1e-5)


def test_names_are_unique_and_have_their_namespace(scene: Scene) -> None:
    spawn = {"entity_resource": resource(), "initial_pose": pose()}
    assert scene.ok("SpawnEntity", name="a", **spawn).entity_name == "a"
    assert scene.ok("SpawnEntity", name="a", allow_renaming=True, **spawn).entity_name == "a_2"
    assert scene.ok("SpawnEntity", name="a", entity_namespace="/robots", **spawn).entity_name == "robots/a"
    assert scene.ok("SpawnEntity", allow_renaming=True, **spawn).entity_name == "vehicle.sedan_103"
    scene.ok("DeleteEntity", entity="robots/a")
    assert scene.ok("SpawnEntity", name="a", entity_namespace="/robots", **spawn).entity_name == "robots/a"


REFUSED_SPAWNS: list[tuple[dict[str, Any], str, str]] = [
    ({"name": "ego"}, "NAME_NOT_UNIQUE", "name: an entity is called ego already"),
    ({"name": ""}, "NAME_INVALID", "name: is empty, and renaming is not allowed"),
    ({"name": "a b"}, "NAME_INVALID", "name: 'a b' must be letters, digits and _ . -, up to 64"),
    ({"entity_resource": resource("")}, "NO_RESOURCE", "entity_resource: has neither a URI nor a string"),
    (
        {"entity_resource": resource("a.sdf")},
        "UNSUPPORTED_FORMAT",
        "entity_resource: 'a.sdf' is a file; name a model",
    ),
    ({"entity_namespace": "1a"}, "NAMESPACE_INVALID", "entity_namespace: '1a' is not a namespace of ROS"),
    ({"initial_pose": pose(np.nan)}, "INVALID_POSE", "pose: has numbers that are not finite"),
    ({"initial_pose": pose(w=0.5)}, "INVALID_POSE", "pose.orientation: has length 0.5; must be 1"),
    ({"initial_pose": pose(1e7)}, "INVALID_POSE", "pose.position: 1e+07, 0, 0 is far from the map"),
    (
        {"initial_pose": pose(frame="nowhere")},
        "INVALID_POSE",
        "frame_id: 'nowhere' is unknown; allowed: map, world, the name of an entity, or base_link of an agent",
    ),
]


@pytest.mark.parametrize(("fields", "code", "words"), REFUSED_SPAWNS)
def test_bad_spawns_have_their_own_codes(scene: Scene, fields: dict[str, Any], code: str, words: str) -> None:
    fields = {"name": "x", "entity_resource": resource(), "initial_pose": pose(), **fields}
    assert scene.refusal("SpawnEntity", **fields) == (getattr(srv.SpawnEntity.Response, code), words)
    assert len(names(scene)) == 5


def test_unknown_models_and_strings_are_refused(scene: Scene) -> None:
    words = "entity_resource: no model is called 'vehicle.ufo'"
    spawn = {"name": "x", "initial_pose": pose()}
    assert scene.refusal("SpawnEntity", entity_resource=resource("vehicle.ufo"), **spawn) == (2, words)
    code, _ = scene.refusal("SpawnEntity", entity_resource=msg.Resource(resource_string="<sdf/>"), **spawn)
    assert code == RESULT.RESULT_FEATURE_UNSUPPORTED


def test_of_several_spawns_those_that_can_be_are_made(scene: Scene) -> None:
    one, two = (msg.SpawnEntity(name=name, entity_resource=resource(), initial_pose=pose()) for name in ("a", "ego"))
    response = scene.call("SpawnEntities", spawn_requests=[one, two])
    assert response.result.result == response.ENTITIES_SPAWN_FAILED
    assert response.result.error_message == "1 of 2 were not spawned"
    assert [each.result.result for each in response.results] == [1, msg.SpawnResult.NAME_NOT_UNIQUE]
    assert [each.entity_name for each in response.results] == ["a", ""]
    assert scene.ok("SpawnEntities", spawn_requests=[msg.SpawnEntity(**{**fields(one), "name": "b"})]).results


def test_more_spawns_than_a_scene_has_room_for_are_refused_at_once(scene: Scene) -> None:
    answer = scene.refusal("SpawnEntities", spawn_requests=[msg.SpawnEntity()] * 1001)
    assert answer == (RESULT.RESULT_OPERATION_FAILED, "spawn_requests: are more than 1000")


def fields(message: Any) -> dict[str, Any]:
    return {name: getattr(message, name) for name in message.get_fields_and_field_types()}


def test_actors_of_the_traffic_are_moved_under_their_names_but_agents_stay(scene: Scene) -> None:
    state = scene.ok("GetEntityState", entity="vehicle.van_2").state
    state.pose.position.x = -3.0
    scene.ok("SetEntityState", entity="vehicle.van_2", state=state, set_pose=True)
    assert scene.ok("GetEntityState", entity="vehicle.van_2").state.pose.position.x == -3.0
    scene.ok("SetEntityState", entity="ego", state=state, set_pose=True)
    assert scene.ok("GetEntityState", entity="ego").state.pose.position.x == -3.0
    assert scene.refusal("DeleteEntity", entity="ego") == (4, "entity: ego carries an agent, which stays")
    scene.ok("DeleteEntity", entity=f"{WALKER}_5")
    assert f"{WALKER}_5" not in names(scene)


def test_a_vehicle_that_is_driven_from_outside_is_not_moved(scene: Scene) -> None:
    scene.spec = with_ego(scene.spec, driver="twist")
    words = "entity: ego is moved by its driver alone"
    assert scene.refusal("SetEntityState", entity="ego", state=msg.EntityState(), set_pose=True) == (4, words)


def test_bad_states_are_refused(scene: Scene) -> None:
    state = msg.EntityState()
    state.twist.linear.x = np.inf
    code, words = scene.refusal("SetEntityState", entity="vehicle.van_2", state=state, set_twist=True)
    assert (code, words) == (4, "state.twist: has numbers that are not finite")
    state.twist.linear.x = -1e300
    code, words = scene.refusal("SetEntityState", entity="vehicle.van_2", state=state, set_twist=True)
    assert (code, words) == (4, "state.twist: has numbers above 1000")
    state.twist.linear.x = 1.0
    words = f"entity: {CONE}_4 is a static object, which cannot move"
    assert scene.refusal("SetEntityState", entity=f"{CONE}_4", state=state, set_twist=True) == (4, words)
    state.pose.orientation.w = 0.0
    code, words = scene.refusal("SetEntityState", entity="vehicle.van_2", state=state, set_pose=True)
    assert (code, words) == (srv.SetEntityState.Response.INVALID_POSE, "pose.orientation: has length 0; must be 1")
    assert scene.refusal("SetEntityState", entity="nobody", state=state)[0] == RESULT.RESULT_NOT_FOUND


def test_named_poses_have_tags_and_room(scene: Scene) -> None:
    poses = scene.ok("GetNamedPoses").poses
    assert len({each.name for each in poses}) == len(poses)
    junctions = scene.ok("GetNamedPoses", tags=msg.TagsFilter(tags=["junction"])).poses
    assert 0 < len(junctions) < len(poses) and all(each.name.startswith("junction/") for each in junctions)
    start = scene.ok("GetNamedPoses", tags=msg.TagsFilter(tags=["start", "vehicle"], filter_mode=1)).poses[0]
    room = scene.ok("GetNamedPoseBounds", name=start.name).bounds
    assert (room.points[0].x, room.points[1].x) == (10.0, -10.0)
    assert scene.refusal("GetNamedPoseBounds", name="x") == (2, "no named pose is called 'x'")


def test_without_a_scene_nothing_is_answered_but_spawnables(scene: Scene) -> None:
    scene.runs = False
    for kind in ("GetEntities", "GetNamedPoses", "DeleteEntity", "SetEntityState"):
        assert scene.refusal(kind) == (RESULT.RESULT_INCORRECT_STATE, "no scene is running")
    assert scene.ok("GetSpawnables").spawnables


def test_a_replay_is_not_changed(scene: Scene) -> None:
    scene.source.entities = None
    words = "a replay shows all actors as they were recorded"
    assert scene.refusal("DeleteEntity", entity="vehicle.van_2") == (RESULT.RESULT_INCORRECT_STATE, words)
    assert len(names(scene)) == 5
