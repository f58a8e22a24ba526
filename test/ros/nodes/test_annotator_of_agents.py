"""An annotator node that serves several agents: each one gets the labels of its own surroundings."""

import json
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from rclpy.serialization import serialize_message
from several_agents import car, roadside_unit, with_agents
from started_nodes import started_node
from synthetic_world import actor, box, cart_model, mesh, sheet, static_scene, world

from simbev_ros.assets.materials import Material
from simbev_ros.config.load import load_scenario
from simbev_ros.foundation.geometry.transforms import apply, inverse
from simbev_ros.foundation.semantics import BEV_CLASSES, Tag
from simbev_ros.foundation.types import Table
from simbev_ros.maps.build import load_network
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.ros.msgs.annotation_topics import annotation_topics, annotator_inputs
from simbev_ros.ros.msgs.displays import recorded_displays
from simbev_ros.ros.msgs.images import image_message, labels_from_image
from simbev_ros.ros.msgs.stamps import stamp_of
from simbev_ros.ros.msgs.tables import message_from_table, table_from_message
from simbev_ros.ros.nodes import annotator_node, surroundings
from simbev_ros.ros.nodes.surroundings import Surroundings
from simbev_ros.scene.drawing.draw_scene import draw_scene, planned_scenes
from simbev_ros.schema.boxes import LIGHT_IDS
from simbev_ros.schema.scene.agents import AgentView, agent_view, agent_views
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import EGO_ID, SIGNAL_DTYPE, WorldState
from simbev_ros.simulation.annotation.scene_annotator import meshes_radius_m
from simbev_ros.simulation.sensors.mount import map_from_sensor

MODELS = (cart_model(),)
CAR_ID = EGO_ID + 1
GAP_M = 12.0
CAMERA: dict[str, Any] = {"width_px": 32, "height_px": 24, "modalities": ["instance"], "rate_hz": 10}
SENSORS: list[dict[str, Any]] = [
    {"type": "lidar", "name": "lidar", "pose": {"z_m": 2.0}},
    {"type": "camera", "name": "cam", "pose": {"x_m": 2.5, "z_m": 1.0}, **CAMERA},
]
ANNOTATION: dict[str, Any] = {
    "bev": {"rows": 80, "columns": 60, "cell_m": 0.5},
    "occupancy": {"half_side_m": 16.0, "rate_hz": None},
    "vector_map": {},
}
POINTS = {"ego": 3, "car": 5, "rsu": 2}
"""Number of points on each other vehicle at tick 0, and of pixels that show it."""
TICKS = range(4)
CLOUD_DTYPE = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4")])


@cache
def drawn() -> tuple[dict[str, Any], RoadNetwork]:
    """A scene on the map Blocks, and its roads."""
    scenario = load_scenario("demo")
    planned = next(planned_scenes(scenario))
    network = load_network(planned.map)
    return draw_scene(scenario, planned, network).model_dump(mode="json"), network


def single(name: str, vehicles: Sequence[dict[str, Any]], annotation: dict[str, Any]) -> SceneSpec:
    """A scene with one agent, which rides in the first vehicle."""
    agent = {"rig": {"agent": name, "sensors": SENSORS}, "annotation": annotation, "vehicle": 0}
    own = {"agents": [agent], "vehicles": vehicles}
    return SceneSpec.model_validate(drawn()[0] | own)


@cache
def scene() -> SceneSpec:
    """Agents with equal rigs: ``ego``, ``car`` in front of it, and ``rsu`` between them beside the road."""
    (x, y, z), yaw = start()
    left = np.array([-np.sin(yaw), np.cos(yaw)]) * 8.0 + GAP_M / 2.0 * np.array([np.cos(yaw), np.sin(yaw)])
    mast = {"x_m": x + left[0], "y_m": y + left[1], "z_m": z, "yaw_rad": yaw - np.pi / 2.0}
    unit = roadside_unit(sensors=SENSORS) | {"station": mast, "annotation": ANNOTATION}
    return with_agents(ego_alone(), car("car", 1, SENSORS, annotation=ANNOTATION), unit)


def ego_alone() -> SceneSpec:
    return single("ego", drawn()[0]["vehicles"], ANNOTATION)


def start() -> tuple[tuple[float, float, float], float]:
    """Where the ego starts, and its yaw."""
    spec, network = drawn()
    lane = spec["vehicles"][0]["start"]
    position_m, yaw_rad = network.pose_on_lane(lane["lane"], lane["s_m"])
    return tuple(position_m.tolist()), float(yaw_rad)


def state_at(tick: int, ego_id: int = EGO_ID, car_id: int = CAR_ID) -> WorldState:
    """The ego, and the car ahead that looks at it; both drive to the ego's left, so that their distance stays."""
    (x, y, z), yaw = start()
    x, y = x - 0.4 * tick * np.sin(yaw), y + 0.4 * tick * np.cos(yaw)
    ahead = {"x": x + GAP_M * np.cos(yaw), "y": y + GAP_M * np.sin(yaw), "z": z, "yaw": yaw + np.pi}
    own = actor(MODELS[0], id=ego_id, x=x, y=y, z=z, yaw=yaw)
    signals = np.zeros(len(drawn()[1].signals), SIGNAL_DTYPE)
    signals["id"] = np.arange(len(signals)) + 1
    state = world(own, actor(MODELS[0], id=car_id, **ahead), tick=tick)
    return replace(state, ego_id=EGO_ID, signals=signals, stamp_ns=scene().stamp_ns(tick))


def sensor_messages(view: AgentView, state: WorldState) -> dict[str, bytes]:
    """Messages of an agent's sensors that are due, by topic: points on the other vehicles, and pixels of them."""
    state, inputs = view.ego_state(state), annotator_inputs(view, compressed_images=False)
    others = state.actors[state.actors["id"] != state.ego_id]
    count = POINTS[view.agent]
    at_m = np.stack([others["x"], others["y"], others["z"] + 0.9], axis=1).repeat(count * (state.tick + 1), axis=0)
    lidar = view.rig.sensors[0]
    cloud = np.zeros(len(at_m), CLOUD_DTYPE)
    cloud["x"], cloud["y"], cloud["z"] = apply(inverse(map_from_sensor(lidar.pose, state)), at_m).T
    sent = {inputs["lidar"].name: serialize_message(message_from_table(cloud, state.stamp_ns, "lidar"))}
    if state.tick % inputs["cam"].period_ticks == 0:
        ids = np.zeros((24, 32), np.uint16)
        for row, other in enumerate(others["id"].tolist()):
            ids[row, :count] = other
        sent[inputs["cam"].name] = serialize_message(image_message(ids, state.stamp_ns, "cam"))
    return sent


@pytest.fixture(scope="module", autouse=True)
def small_world() -> Iterator[None]:
    (x, y, z), _ = start()
    ground = mesh(sheet([x - 60, y - 60], [x + 60, y + 60], z), Tag.ROAD, Material.ASPHALT)
    building = mesh(box([x - 9, y + 7, z + 2], [3, 5, 4]), Tag.BUILDING, Material.BRICK)
    static = static_scene(ground, building)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(annotator_node, "load_models", lambda: MODELS)
        patch.setattr(surroundings, "loaded_reach", lambda *_: None)
        patch.setattr(surroundings, "load_static_scene", lambda *_, **__: static)
        patch.setattr(surroundings, "_loaded", {})
        yield


@pytest.fixture(scope="module")
def sent(small_world: None) -> dict[str, list[Any]]:
    """What one node publishes of the scene, by topic, and the ticks that it reports."""
    return published(scene())


def collect(node: Any, spec: SceneSpec) -> dict[str, list[Any]]:
    """Let a node begin a scene; return what it is going to publish, by topic, and the ticks that it reports."""
    sent: dict[str, list[Any]] = defaultdict(list)
    node.spec, node._joined._is_sent = spec, lambda _: True
    node.publish = lambda name, message: sent[name].append(message)
    node.report_finished = lambda _, tick: sent["finished"].append(tick)
    return sent


def events(
    spec: SceneSpec, states: Sequence[WorldState], seed: int | None = None
) -> Iterator[tuple[WorldState, str, bytes]]:
    """States (without a topic) and sensors' messages, each stream in its order; a seed mixes the streams."""
    streams: dict[str, list[tuple[WorldState, str, bytes]]] = defaultdict(list)
    for state in states:
        streams[""].append((state, "", b""))
        for view in agent_views(spec):
            for name, payload in sensor_messages(view, state).items():
                streams[name].append((state, name, payload))
    rng = None if seed is None else np.random.default_rng(seed)
    waiting = [stream for stream in streams.values() if stream]
    while waiting:
        index = 0 if rng is None else int(rng.integers(len(waiting)))
        yield waiting[index].pop(0)
        waiting = [stream for stream in waiting if stream]


def play(node: Any, spec: SceneSpec, arriving: Iterable[tuple[WorldState, str, bytes]]) -> dict[str, list[Any]]:
    sent = collect(node, spec)
    for state, topic, payload in arriving:
        if not topic:
            node.process(spec, state)
            node.finish(spec, state)
        elif topic in node._joined._subscriptions:
            node._joined._subscriptions[topic].callback(payload)
    node._send(0)
    return dict(sent)


def published(spec: SceneSpec, seed: int | None = None, **parameters: object) -> dict[str, list[Any]]:
    with started_node("annotator", spec, compressed=False, **parameters) as node:
        return play(node, spec, events(spec, [state_at(tick) for tick in TICKS], seed))


def actor_boxes(message: Any) -> Table:
    table = table_from_message(message)
    return table[table["id"] < LIGHT_IDS]


def labels_of(sent: dict[str, list[Any]], agent: str) -> dict[str, list[Any]]:
    return {name: messages for name, messages in sent.items() if name.startswith(f"/{agent}/")}


def test_labels_of_all_agents_are_published_at_each_tick_and_in_their_frames(sent: dict[str, list[Any]]) -> None:
    spec = scene()
    assert sent["finished"] == list(TICKS)
    for view in agent_views(spec):
        topics, own = annotation_topics(view), labels_of(sent, view.agent)
        for name in (topics.boxes.name, topics.bev_labels.name, topics.hd_map.name):
            assert len(own[name]) == len(TICKS)
        assert len(own[topics.views["cam"].name]) == len(TICKS) // 2
        frames = {message.header.frame_id for message in own[topics.views["cam"].name]}
        assert frames == {f"{view.agent}/cam_optical"}
        assert {message.header.frame_id for message in own[topics.bev_labels.name]} == {f"{view.agent}/base_link"}


def test_an_agent_is_in_the_boxes_of_the_others_with_their_own_distances_and_points(sent: dict[str, list[Any]]) -> None:
    across_m = [float(np.hypot(8.0 - 0.4 * tick, GAP_M / 2.0)) for tick in TICKS]
    expected = {"ego": ([CAR_ID], [GAP_M] * 4), "car": ([EGO_ID], [GAP_M] * 4), "rsu": ([EGO_ID, CAR_ID], across_m)}
    for agent, (ids, distance_m) in expected.items():
        for tick, message in enumerate(sent[f"/{agent}/boxes"]):
            boxes = actor_boxes(message)
            assert boxes["id"].tolist() == ids
            height_m = 0.85 if agent == "rsu" else 0.05  # middle of its body above the foot, or the middle of the box
            np.testing.assert_allclose(boxes["distance"], np.hypot(distance_m[tick], height_m), rtol=1e-5)
            assert set(boxes["lidar_points"].tolist()) == {POINTS[agent] * (tick + 1)}
            assert np.isfinite(boxes["visibility"]).all() == (tick % 2 == 0)


def test_grids_are_around_the_agent_that_they_belong_to(sent: dict[str, list[Any]]) -> None:
    bit = np.uint16(1 << BEV_CLASSES.index("car"))
    covered = {agent: labels_from_image(sent[f"/{agent}/bev/labels"][0]) & bit > 0 for agent in POINTS}
    rows, _ = np.nonzero(covered["ego"])
    assert (rows.min(), rows.max()) == (12, 43), "the car at 12 m, and the ego's own tail at -2 m; row 40 is at 0 m"
    np.testing.assert_array_equal(covered["ego"], covered["car"])
    rows, _ = np.nonzero(covered["rsu"])
    assert rows.min() >= 20 and rows.max() < 30, "both vehicles are 7 to 9 m ahead, and there is none at the mast"


@pytest.mark.parametrize("seed", range(2))
def test_messages_of_sensors_and_world_may_arrive_in_any_order(sent: dict[str, list[Any]], seed: int) -> None:
    assert published(scene(), seed) == sent


def test_a_tick_is_finished_once_and_only_when_the_messages_of_all_agents_are_there() -> None:
    spec, state = scene(), state_at(0)
    messages = {name: payload for view in agent_views(spec) for name, payload in sensor_messages(view, state).items()}
    with started_node("annotator", spec, compressed=False) as node:
        sent = collect(node, spec)
        node.process(spec, state)
        node.finish(spec, state)
        assert len(messages) == 6
        for name, payload in messages.items():
            node._send(0)
            assert "finished" not in sent and "/ego/boxes" not in sent
            node._joined._subscriptions[name].callback(payload)
            node._joined._subscriptions[name].callback(payload)
        node._send(0)
        assert sent["finished"] == [0]
        assert [len(sent[f"/{agent}/boxes"]) for agent in POINTS] == [1, 1, 1]


def test_a_malformed_message_concerns_the_agent_of_its_sensor_only() -> None:
    spec, state = scene(), state_at(0)
    with started_node("annotator", spec, compressed=False) as node:
        broken = [
            (state, name, payload[: len(payload) // 2] if name.startswith("/car/lidar/") else payload)
            for state, name, payload in events(spec, [state])
        ]
        sent = play(node, spec, broken)
    points = {agent: actor_boxes(sent[f"/{agent}/boxes"][0])["lidar_points"].tolist() for agent in POINTS}
    assert points == {"ego": [3], "car": [-1], "rsu": [2, 2]}


@pytest.mark.parametrize("scope", [["boxes", "views", "surroundings"], ["views"], ["surroundings"]])
def test_nodes_that_share_the_agents_publish_what_a_single_one_would(scope: list[str]) -> None:
    spec, own = scene(), f"[{','.join(scope)}]"
    apart: dict[str, list[Any]] = {}
    for share, agent in enumerate(POINTS):
        alone = published(spec, scope=own, agent_share=share, agent_shares=3)
        assert alone.pop("finished") == list(TICKS)
        assert alone and labels_of(alone, agent) == alone
        apart |= alone
    all_agents = published(spec, scope=own)
    del all_agents["finished"]
    assert apart == all_agents


def test_the_first_agents_labels_are_those_of_a_scene_in_which_it_is_alone(sent: dict[str, list[Any]]) -> None:
    alone = published(ego_alone())
    del alone["finished"]
    assert alone == labels_of(sent, "ego")


def test_another_agents_labels_are_those_of_a_scene_in_which_it_is_the_first_one(sent: dict[str, list[Any]]) -> None:
    vehicles = drawn()[0]["vehicles"]
    alone = single("car", [vehicles[1], vehicles[0], *vehicles[2:]], ANNOTATION)
    states = [state_at(tick, ego_id=CAR_ID, car_id=EGO_ID) for tick in TICKS]  # as the car is the first vehicle there
    with started_node("annotator", alone, compressed=False) as node:
        expected = play(node, alone, events(alone, states))
    found = labels_of(sent, "car")
    assert expected.keys() - {"finished"} == found.keys()
    for name, messages in found.items():
        for message, other in zip(messages, expected[name], strict=True):
            if name.endswith("/boxes"):
                table, wanted = table_from_message(message).copy(), table_from_message(other)
                assert (table["id"] == EGO_ID).sum() == (wanted["id"] == CAR_ID).sum() == 1
                table["id"][table["id"] == EGO_ID] = CAR_ID
                assert table.tobytes() == wanted.tobytes()
            else:
                assert message == other


def test_agents_share_what_is_prepared_from_meshes() -> None:
    with started_node("annotator", scene()) as node:
        assert [agent.view.agent for agent in node._agents] == list(POINTS)
        assert {id(agent.annotator._meshes) for agent in node._agents} == {id(node._surroundings.built)}


def test_meshes_are_loaded_as_far_as_any_agent_of_the_scene_needs_them(monkeypatch: pytest.MonkeyPatch) -> None:
    wide = ANNOTATION | {"bev": {"rows": 400, "columns": 300, "cell_m": 0.5}}
    spec = with_agents(ego_alone(), car("car", 1, SENSORS, annotation=wide))
    assert meshes_radius_m(spec) == 125.0
    assert meshes_radius_m(ego_alone()) == 25.0
    loaded, load = [], Surroundings.load

    def remember(self: Any, spec: SceneSpec, view_m: float) -> Any:
        loaded.append(view_m)
        return load(self, spec, view_m)

    monkeypatch.setattr(Surroundings, "load", remember)
    for share in range(2):
        with started_node("annotator", spec, agent_share=share, agent_shares=2):
            pass
    assert loaded == [125.0, 125.0]


@pytest.mark.parametrize("scope", ["boxes", "surroundings"])
def test_a_node_without_agents_reports_its_ticks_and_loads_nothing(scope: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(annotator_node, "MeshAnnotators", None)
    spec = scene()
    with started_node("annotator", spec, scope=f"[{scope}]", agent_share=3, agent_shares=4) as node:
        assert node.topics == [] and not node._joined._subscriptions
        assert not node.is_due(spec, 0)
        sent = play(node, spec, [(state_at(tick), "", b"") for tick in range(-2, 3)])
    assert sent == {"finished": [-2, -1, 0, 1, 2]}


def test_a_scene_with_fewer_agents_may_follow() -> None:
    alone = ego_alone()
    with started_node("annotator", scene(), compressed=False) as node:
        play(node, scene(), events(scene(), [state_at(0)]))
        before = dict(node._joined._subscriptions)
        node.start_scene(alone)
        names = {topic.name for topic in annotator_inputs(agent_view(alone), compressed_images=False).values()}
        assert node._joined._subscriptions == {name: before[name] for name in names}, "those of the ego are kept"
        sent = play(node, alone, events(alone, [state_at(tick) for tick in TICKS]))
    assert sent == published(alone)


def test_topics_of_all_agents_can_be_recorded() -> None:
    spec = scene()
    with started_node("annotator", spec) as node:
        recorded = node.topics
    displays = {display.topic.name for display in recorded_displays(spec)}  # the recorder makes them
    expected = {topic.name for view in agent_views(spec) for topic in annotation_topics(view).recorded}
    assert sorted(recorded) == sorted(expected - displays)


def with_label_rates(**rates_hz: float) -> SceneSpec:
    """The scene with other rates of the labels of some agents."""
    data = scene().model_dump(mode="json")
    for agent in data["agents"]:
        agent["annotation"]["rate_hz"] = rates_hz.get(agent["rig"]["agent"])
    return SceneSpec.model_validate(data)


@pytest.mark.parametrize("scope", [["boxes", "views", "surroundings"], ["views"], ["surroundings"]])
@pytest.mark.parametrize("rates_hz", [{"ego": 5, "car": 5, "rsu": 5}, {"ego": 10, "rsu": 5}])
@pytest.mark.parametrize("seed", range(2))
def test_labels_at_a_rate_are_those_of_the_same_ticks(scope: list[str], rates_hz: dict[str, float], seed: int) -> None:
    own = f"[{','.join(scope)}]"
    sent, every_tick = published(with_label_rates(**rates_hz), seed, scope=own), published(scene(), scope=own)
    assert sent.pop("finished") == every_tick.pop("finished") == list(TICKS)
    expected = {name: kept(messages, rates_hz.get(name.split("/")[1])) for name, messages in every_tick.items()}
    assert sent == expected
    assert sum(map(len, sent.values())) < sum(map(len, every_tick.values()))


def kept(messages: list[Any], rate_hz: float | None) -> list[Any]:
    """Messages at ticks that have labels at a rate."""
    period_ns = scene().tick_ns * (1 if rate_hz is None else round(20 / rate_hz))
    return [message for message in messages if (stamp_ns_of(message) - scene().start_ns) % period_ns == 0]


def stamp_ns_of(message: Any) -> int:
    if not hasattr(message, "header"):
        return int(json.loads(message.data)["stamp_ns"])
    return stamp_of(message.header.stamp)


def test_nothing_is_labeled_or_read_at_a_tick_without_labels(monkeypatch: pytest.MonkeyPatch) -> None:
    spec = with_label_rates(ego=10, car=10, rsu=10)
    done: list[str] = []
    with started_node("annotator", spec, compressed=False) as node:
        for agent in node._agents:
            for name in ("boxes", "surroundings"):
                monkeypatch.setattr(agent.annotator, name, lambda *_, name=name: done.append(name))
        monkeypatch.setattr(node, "_read_sensor", lambda *_: done.append("read"))
        sent = play(node, spec, events(spec, [state_at(1), state_at(3)]))
        assert (done, sent) == ([], {"finished": [1, 3]})
        assert [node.is_due(spec, tick) for tick in TICKS] == [True, False, True, False]


def test_a_sensors_period_follows_from_the_scene_and_not_from_an_earlier_one() -> None:
    slow, fast = with_label_rates(ego=5, car=5, rsu=5), scene()
    with started_node("annotator", slow, compressed=False) as node:
        play(node, slow, events(slow, [state_at(0)]))
        node.start_scene(fast)
        sent = play(node, fast, events(fast, [state_at(tick) for tick in TICKS]))
    assert sent["finished"] == list(TICKS) and len(sent["/ego/boxes"]) == len(TICKS)
