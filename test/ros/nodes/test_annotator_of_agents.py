"""An annotator node that serves several agents: each one gets the labels of its own surroundings."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from annotated_agents import (
    ANNOTATION,
    CAR_ID,
    GAP_M,
    POINTS,
    SENSORS,
    TICKS,
    actor_boxes,
    collect,
    drawn,
    ego_alone,
    events,
    labels_of,
    play,
    published,
    scene,
    sensor_messages,
    single,
    small_world,
    state_at,
)
from several_agents import car, with_agents
from started_nodes import started_node

from simbev_ros.foundation.semantics import BEV_CLASSES
from simbev_ros.ros.msgs.annotation_topics import annotation_topics, annotator_inputs
from simbev_ros.ros.msgs.displays import recorded_displays
from simbev_ros.ros.msgs.images import labels_from_image
from simbev_ros.ros.msgs.tables import table_from_message
from simbev_ros.ros.nodes import annotator_node
from simbev_ros.ros.nodes.surroundings import Surroundings
from simbev_ros.schema.scene.agents import agent_view, agent_views
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import EGO_ID
from simbev_ros.simulation.annotation.scene_annotator import meshes_radius_m


@pytest.fixture(scope="module", autouse=True)
def loaded_world() -> Iterator[None]:
    with small_world():
        yield


@pytest.fixture(scope="module")
def sent(loaded_world: None) -> dict[str, list[Any]]:
    """What one node publishes of the scene, by topic, and the ticks that it reports."""
    return published(scene())


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
