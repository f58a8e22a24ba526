"""The world node publishes the motion and the model of every agent of a scene, and each agent has its own commands."""

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import rclpy
from geometry_msgs.msg import Twist
from made_up_scene import made_up_spec
from pyproj import Transformer
from ros_domain import DOMAIN
from scene_edits import with_ego
from several_agents import car, made_up_agents, roadside_unit, with_agents
from std_srvs.srv import Trigger

from simbev_ros.assets.regions.region_scene import Streetside
from simbev_ros.foundation.geometry.transforms import matrices_from_xyz_rpy
from simbev_ros.ros.conventions.names import NodeName
from simbev_ros.ros.msgs import topics, transforms
from simbev_ros.ros.msgs.robot_description import robot_description
from simbev_ros.ros.msgs.stamps import stamp_of
from simbev_ros.ros.msgs.tables import table_from_message
from simbev_ros.ros.msgs.world import map_from_base_link, weather_from_message
from simbev_ros.ros.nodes import world_node
from simbev_ros.ros.nodes.world_node import WorldNode
from simbev_ros.scene.ending import DURATION
from simbev_ros.scene.request import SceneRequest
from simbev_ros.scene.weather_course import WeatherCourse
from simbev_ros.schema.scene.agents import agent_views
from simbev_ros.schema.scene.spec import DatumSpec, SceneSpec
from simbev_ros.schema.scene.state import ACTOR_DTYPE, EGO_ID, SIGNAL_DTYPE, SignalState, WorldState, map_from_actors


class Parade:
    """A source of states in which each vehicle drives along x at a speed of its own; keeps the commands."""

    def __init__(self, spec: SceneSpec) -> None:
        self.available = spec.ticks, DURATION
        self.commands: list[tuple[int, float, float]] = []
        self.held: list[tuple[int, SignalState | None]] = []
        self.weather = WeatherCourse(spec)
        self._spec, self._tick = spec, -spec.warm_up_ticks

    def drive_vehicle(self, vehicle: int, speed_mps: float, yaw_rate_radps: float) -> None:
        self.commands.append((vehicle, speed_mps, yaw_rate_radps))

    def hold_signal(self, head: int, state: SignalState | None) -> int:
        self.held.append((head, state))
        return self._tick + 7

    def step(self) -> WorldState:
        tick, self._tick = self._tick, self._tick + 1
        actors = np.zeros(len(self._spec.vehicles), ACTOR_DTYPE)
        actors["id"] = EGO_ID + np.arange(len(actors))
        actors["vx"] = 5.0 * actors["id"]
        actors["x"], actors["y"], actors["yaw"] = actors["vx"] * 0.05 * tick, 4.0 * actors["id"], 0.1 * actors["id"]
        signals = np.zeros(0, SIGNAL_DTYPE)
        return WorldState(self._spec.stamp_ns(tick), tick, EGO_ID, actors, signals, self.weather.at(tick))

    def close(self) -> None:
        pass


class Sent(list[Any]):
    """Stands in for a publisher."""

    def publish(self, message: Any) -> None:
        self.append(message)


@pytest.fixture
def node(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """A world node without participants to wait for, which collects what it publishes in ``sent``, by topic."""
    monkeypatch.setattr(world_node, "loaded_reach", lambda *_: None)
    monkeypatch.setattr(
        world_node,
        "load_streetside",
        lambda *_, **__: Streetside(np.zeros((0, 3)), np.zeros(0), (), np.zeros(0), np.zeros(0)),
    )
    monkeypatch.setattr(world_node, "_make_source", lambda request, *_: Parade(request.spec))
    rclpy.init(domain_id=DOMAIN)
    made: Any = WorldNode(NodeName("world"))
    made.sent = {}
    monkeypatch.setattr(made, "publish", lambda name, message: made.sent.setdefault(name, []).append(message))
    monkeypatch.setattr(transforms, "TFMessage", SimpleNamespace)
    made._transforms._publishers = {topics.TF: Sent(), topics.TF_STATIC: Sent()}
    for publisher in made._transforms._publishers.values():
        publisher.get_subscription_count = lambda: 1
    yield made
    made.close()
    made.destroy_node()
    rclpy.shutdown()


def play(node: Any, spec: SceneSpec) -> None:
    node.start(SceneRequest(spec=spec))
    node.advance()


def send(node: Any, topic: str, speed_mps: float, yaw_rate_radps: float) -> None:
    """Deliver a command to the node's only subscription to a topic."""
    (subscription,) = [each for each in node.subscriptions if each.topic_name == topic]
    message = Twist()
    message.linear.x, message.angular.z = speed_mps, yaw_rate_radps
    subscription.callback(message)


def commanded(node: Any) -> list[str]:
    return sorted(each.topic_name for each in node.subscriptions if each.topic_name.endswith("/cmd_vel"))


def test_the_odometry_of_each_agent_is_the_row_of_its_actor(node: Any) -> None:
    spec = made_up_agents()
    play(node, spec)
    tables = node.sent[topics.ACTORS]
    assert len(tables) == spec.lead_in_ticks + spec.ticks
    for name, row in (("ego", 0), ("car", 2)):
        for table, odometry in zip(tables, node.sent[f"/{name}/odom"], strict=True):
            actors = table_from_message(table)
            np.testing.assert_allclose(map_from_base_link(odometry), map_from_actors(actors)[row], atol=1e-9)
            assert (odometry.header, odometry.child_frame_id) == (table.header, f"{name}/base_link")


def test_the_odometry_of_a_roadside_unit_stays_at_its_foot_at_every_tick(node: Any) -> None:
    spec = made_up_agents()
    play(node, spec)
    foot = matrices_from_xyz_rpy(np.array([12.0, -3.0, 1.0]), np.array([0.0, 0.0, 1.5]))
    for table, odometry in zip(node.sent[topics.ACTORS], node.sent["/rsu/odom"], strict=True):
        np.testing.assert_allclose(map_from_base_link(odometry), foot, atol=1e-7)
        assert odometry.header == table.header


def test_one_message_of_transforms_per_tick_has_all_agents(node: Any) -> None:
    spec = made_up_agents()
    play(node, spec)
    moving, static = (node._transforms._publishers[name] for name in (topics.TF, topics.TF_STATIC))
    assert len(moving) == spec.lead_in_ticks + spec.ticks and len(static) == 1
    for message in moving:
        frames = [each.child_frame_id for each in message.transforms]
        assert frames == ["ego/base_link", "car/base_link", "rsu/base_link"]
        assert len({stamp_of(each.header.stamp) for each in message.transforms}) == 1
    (message,) = static
    assert {"ego/lidar", "car/lidar", "rsu/lidar"} <= {each.child_frame_id for each in message.transforms}


def test_each_agent_has_a_description_and_a_path(node: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    spec, paths = made_up_agents(), dict[str, list[Any]]()
    monkeypatch.setattr(
        node, "publish_derived", lambda _, contents: [*map(paths.__setitem__, contents, contents.values())]
    )
    play(node, spec)
    for view, name in zip(agent_views(spec), ("", "/car", "/rsu"), strict=True):
        (message,) = node.sent[f"{name}/robot_description"]
        assert message.data == robot_description(view)
    assert [path for path in paths if path.endswith("/odom")] == ["/ego/odom", "/car/odom", "/rsu/odom"]
    for name, end_m in (("ego", [0.5, 4.0, 0.0]), ("car", [1.5, 12.0, 0.0]), ("rsu", [12.0, -3.0, 1.0])):
        pose = paths[f"/{name}/odom"][-1]
        assert (pose.stamp_ns, pose.position_m) == (spec.stamp_ns(2), pytest.approx(end_m))


def test_each_agent_driven_from_outside_has_its_own_commands(node: Any) -> None:
    first = with_ego(made_up_spec([], number=2), driver="twist")
    spec = with_agents(first, car("car", 2, [], driver="twist"), car("other", 1, []), roadside_unit())
    node.start(SceneRequest(spec=spec))
    assert commanded(node) == ["/car/cmd_vel", "/ego/cmd_vel"]
    send(node, "/car/cmd_vel", 3.0, 0.1)
    send(node, "/ego/cmd_vel", 7.0, -0.2)
    assert node._scene.source.commands == [(2, 3.0, 0.1), (0, 7.0, -0.2)]


def test_commands_reach_the_vehicle_that_the_agent_has_in_the_present_scene(node: Any) -> None:
    spec = made_up_spec([], number=2)
    agents = [car("car", 2, [], driver="twist")], [car("a", 1, []), car("car", 3, [], driver="twist")], []
    for further, commands in zip(agents, ([(2, 3.0, 0.1)], [(3, 3.0, 0.1)], []), strict=True):
        node.start(SceneRequest(spec=with_agents(spec, *further)))
        assert commanded(node) == ["/car/cmd_vel"]
        send(node, "/car/cmd_vel", 3.0, 0.1)
        assert node._scene.source.commands == commands
    node.close()
    send(node, "/car/cmd_vel", 3.0, 0.1)


def test_a_scene_with_one_agent_has_the_topics_of_earlier_versions(node: Any) -> None:
    spec = made_up_spec([], number=2)
    play(node, spec)
    assert commanded(node) == []
    assert [name for name in node.sent if name.startswith("/ego/") or name.endswith("description")] == [
        "/robot_description",
        "/ego/odom",
    ]


@pytest.mark.parametrize(
    ("live", "recorded", "answer"),
    [
        (True, False, "restarted"),
        (True, True, "a scene that is recorded cannot start again"),
        (False, False, "only a live scene can start again; in lockstep all nodes are in the middle of this one"),
    ],
)
def test_only_a_live_scene_that_is_not_recorded_starts_again(
    node: Any, live: bool, recorded: bool, answer: str
) -> None:
    node.start(SceneRequest(spec=made_up_spec([], number=2)))
    node.live, node._recorded = live, recorded
    (service,) = [each for each in node.services if each.srv_name == "/world/reset"]
    response = service.callback(Trigger.Request(), Trigger.Response())
    assert (response.success, response.message) == (answer == "restarted", answer)


def call(node: Any, name: str, **fields: Any) -> Any:
    """Answer of the node's service to a request."""
    (service,) = [each for each in node.services if each.srv_name == name]
    return service.callback(service.srv_type.Request(**fields), service.srv_type.Response())


def test_the_weather_changes_at_the_next_tick_or_at_the_asked_one(node: Any) -> None:
    pytest.importorskip("simbev_interfaces")
    assert call(node, "/world/set_weather", parameters="{wetness: 1}").message == "no scene is running"
    spec = made_up_spec([], ticks=20)
    node.start(SceneRequest(spec=spec))
    first = call(node, "/world/set_weather", parameters="{wetness: 90}")
    assert (first.success, first.tick, first.message) == (True, -spec.lead_in_ticks, "")
    later = call(
        node, "/world/set_weather", parameters="{sun: {date: 2026-06-21, hour: 12, latitude_deg: 48}}", tick=10
    )
    assert (later.success, later.tick) == (True, 10)
    node.advance()
    weathers = [weather_from_message(message)[1] for message in node.sent[topics.WEATHER]][spec.lead_in_ticks :]
    assert {each.wetness for each in weathers} == {90.0}
    assert [each.sun_altitude_deg for each in weathers[:10]] == [spec.weather.sun_altitude_deg] * 10
    assert [each.sun_altitude_deg for each in weathers[10:]] == pytest.approx([65.4] * 10, abs=0.1)


@pytest.mark.parametrize(
    ("fields", "problem"),
    [
        ({"parameters": "{rain: 3}"}, "parameters: rain: "),
        ({"parameters": "{wetness: 300}"}, "parameters: wetness: "),
        ({"parameters": "wet"}, "parameters: must be like {precipitation: 80}; names are cloudiness, "),
        ({"parameters": "{"}, "parameters: "),
        ({"parameters": "{wetness: 3}", "tick": 20}, "tick: is 20; allowed: "),
        ({"parameters": "{wetness: 3}", "transition": float("nan")}, "transition: is nan s; allowed: 0 to 3600 s"),
    ],
)
def test_a_wrong_weather_is_refused_in_words(node: Any, fields: dict[str, Any], problem: str) -> None:
    pytest.importorskip("simbev_interfaces")
    node.start(SceneRequest(spec=made_up_spec([], ticks=20)))
    answer = call(node, "/world/set_weather", **fields)
    assert not answer.success and answer.message.startswith(problem)


def test_traffic_lights_are_held_and_released(node: Any) -> None:
    pytest.importorskip("simbev_interfaces")
    node.start(SceneRequest(spec=made_up_spec([], ticks=20)))
    source = node._scene.source
    assert call(node, "/world/hold_signal", id=3, state=SignalState.GREEN).success
    assert call(node, "/world/hold_signal", id=0, state=255).tick == source._tick + 7
    assert source.held == [(3, SignalState.GREEN), (0, None)]
    assert call(node, "/world/hold_signal", id=3, state=2).message == (
        "state: is 2; allowed: 1 (red), 3 (green), 255 (automatic)"
    )


def test_rotations_keep_their_signs_where_a_heading_passes_180_degrees(node: Any) -> None:
    spec = made_up_spec([], ticks=6)
    node.start(SceneRequest(spec=spec))
    source = node._scene.source
    step = source.step

    def turning() -> WorldState:
        state = step()
        state.actors["yaw"] = np.remainder(3.05 + 0.05 * state.tick + np.pi, 2.0 * np.pi) - np.pi
        return state

    source.step = turning
    node.advance()
    odometry = node.sent["/ego/odom"][spec.lead_in_ticks :]
    moving = [each.transforms[0].transform.rotation for each in node._transforms._publishers[topics.TF]]
    for rotations in ([each.pose.pose.orientation for each in odometry], moving[spec.lead_in_ticks :]):
        wxyz = np.array([[each.w, each.x, each.y, each.z] for each in rotations])
        assert wxyz[0, 0] > 0.0 > wxyz[-1, 0]
        assert np.abs(np.diff(wxyz, axis=0)).max() < 0.03


def test_the_map_hangs_from_the_earth_at_its_altitude(node: Any) -> None:
    datum = DatumSpec(latitude_deg=45.5, longitude_deg=-122.7, altitude_m=15.0, map_from_east_rad=0.0)
    play(node, made_up_spec([], ticks=1).model_copy(update={"datum": datum}))
    (message,) = node._transforms._publishers[topics.TF_STATIC]
    earth = message.transforms[0]
    assert (earth.header.frame_id, earth.child_frame_id) == ("earth", "map")
    position = earth.transform.translation
    altitude_m = Transformer.from_crs("EPSG:4978", "EPSG:4979").transform(position.x, position.y, position.z)[2]
    assert altitude_m == pytest.approx(15.0, abs=1e-6)
