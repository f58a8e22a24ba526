"""The joint node: one table of boxes a tick, as soon as the boxes of all agents are there."""

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from made_up_scene import made_up_spec
from rclpy.serialization import serialize_message
from several_agents import made_up_agents
from started_nodes import started_node
from synthetic_world import actor, cart_model, world

from simbev_ros.foundation.types import Table
from simbev_ros.ros.msgs.joint_topics import joint_boxes_topic
from simbev_ros.ros.msgs.tables import message_from_table, table_from_message
from simbev_ros.ros.msgs.topic import Topic
from simbev_ros.schema.boxes import blank_boxes
from simbev_ros.schema.scene.agents import agent_views
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import EGO_ID, WorldState
from simbev_ros.simulation.annotation.boxes.joint import join_boxes

AGENTS = ("ego", "car", "rsu")
TICKS = range(-1, 3)


def state_at(tick: int) -> WorldState:
    return replace(world(actor(cart_model(), id=EGO_ID), tick=tick), stamp_ns=made_up_agents().stamp_ns(tick))


def boxes_of(agent: str, tick: int) -> Table:
    rows = blank_boxes(2)
    rows["id"], rows["x"] = (5, 8), (tick, 40)
    rows["lidar_points"] = AGENTS.index(agent), tick
    return rows


def message_of(spec: SceneSpec, boxes: Table, tick: int) -> bytes:
    return serialize_message(message_from_table(boxes, spec.stamp_ns(tick), "map"))


def arriving(spec: SceneSpec, seed: int) -> Iterable[tuple[str, int, bytes]]:
    """States (without an agent) and boxes, each stream in the order of ticks; the seed mixes the streams."""
    streams = {"": [("", tick, b"") for tick in TICKS]}
    for agent in AGENTS:
        streams[agent] = [(agent, tick, message_of(spec, boxes_of(agent, tick), tick)) for tick in TICKS if tick >= 0]
    rng = np.random.default_rng(seed)
    while waiting := [stream for stream in streams.values() if stream]:
        yield waiting[int(rng.integers(len(waiting)))].pop(0)


def play(node: Any, spec: SceneSpec, events: Iterable[tuple[str, int, bytes]]) -> dict[str, list[Any]]:
    """What the node publishes by topic, and the ticks that it reports."""
    sent: dict[str, list[Any]] = defaultdict(list)
    node.spec, node._joined._is_sent = spec, lambda _: True
    node.publish = lambda name, message: sent[name].append(message)
    node.report_finished = lambda _, tick: sent["finished"].append(tick)
    for agent, tick, payload in events:
        if agent:
            node._joined._subscriptions[f"/{agent}/boxes"].callback(payload)
        else:
            node.process(spec, state_at(tick))
            node.finish(spec, state_at(tick))
    return dict(sent)


@pytest.mark.parametrize("seed", range(4))
def test_one_table_a_tick_is_published_in_whatever_order_messages_arrive(seed: int) -> None:
    spec = made_up_agents()
    with started_node("joint", spec) as node:
        assert node.topics == ["/world/boxes"]
        sent = play(node, spec, arriving(spec, seed))
    assert sent["finished"] == list(TICKS)
    recorded = TICKS[1:]
    expected = [join_boxes(AGENTS, {agent: boxes_of(agent, tick) for agent in AGENTS}).rows for tick in recorded]
    found = sent["/world/boxes"]
    assert [table_from_message(message).tobytes() for message in found] == [rows.tobytes() for rows in expected]
    assert [message.header.stamp.nanosec for message in found] == [spec.stamp_ns(tick) % 10**9 for tick in recorded]
    assert {message.header.frame_id for message in found} == {"map"}


def test_a_tick_is_finished_when_the_boxes_of_the_last_agent_are_there() -> None:
    spec = made_up_agents()
    with started_node("joint", spec) as node:
        sent: dict[str, list[Any]] = {}
        events = [("", 0, b""), *((agent, 0, message_of(spec, boxes_of(agent, 0), 0)) for agent in AGENTS)]
        for count in range(len(events) + 1):
            node.start_scene(spec)
            sent = play(node, spec, events[:count])
            assert ("finished" in sent) == (count == len(events))
    assert sent["finished"] == [0]


def test_a_scene_with_one_agent_has_no_joint_boxes_and_its_ticks_are_finished_at_once() -> None:
    spec = made_up_spec([])
    with started_node("joint", spec) as node:
        assert node.topics == []
        assert play(node, spec, [("", tick, b"") for tick in TICKS]) == {"finished": list(TICKS)}
        assert not node.is_due(spec, 0)


def test_subscriptions_follow_the_agents_of_the_scene() -> None:
    spec = made_up_agents()
    with started_node("joint", spec) as node:
        state = len(node.inputs) - len(AGENTS)
        node.start_scene(made_up_spec([]))
        assert len(node.inputs) == state
        node.start_scene(spec)
        assert {subscription.topic_name for subscription in node.inputs[state:]} == {
            f"/{name}/boxes" for name in AGENTS
        }


def test_malformed_boxes_are_ignored_and_contradicting_ones_do_not_count() -> None:
    spec = made_up_agents()
    contradicting = boxes_of("car", 0)
    contradicting["x"][1] += 1.0
    payloads = {agent: message_of(spec, boxes_of(agent, 0), 0) for agent in AGENTS}
    events = [("", 0, b""), ("rsu", 0, payloads["rsu"][:-40])]
    events += [(agent, 0, payload) for agent, payload in payloads.items() if agent != "car"]
    events += [("car", 0, message_of(spec, contradicting, 0))]
    with started_node("joint", spec) as node:
        sent = play(node, spec, events)
        assert node.meter.read()["ignored"] == 2
    rows = table_from_message(sent["/world/boxes"][0])
    assert rows["lidar_points"].tolist() == [2, 0]
    assert rows["car.lidar_points"].tolist() == [-1, -1]


def test_live_boxes_that_never_arrive_are_given_up() -> None:
    spec = made_up_agents()
    with started_node("joint", spec, live=True) as node:
        events = [
            event
            for tick in range(20)
            for event in (("", tick, b""), ("ego", tick, message_of(spec, boxes_of("ego", tick), tick)))
        ]
        sent = play(node, spec, events)
    assert sent["finished"] == [0, 1, 2, 3]
    assert table_from_message(sent["/world/boxes"][0])["car.distance"].tolist() == [np.inf, np.inf]


def test_annotators_wait_for_all_nodes_that_read_boxes_of_several_agents() -> None:
    spec = made_up_agents()
    names = [f"/{view.agent}/boxes" for view in agent_views(spec)]
    with started_node("joint", spec, recorded=True, box_readers=2) as node:
        assert node._expected_readers(spec, names) == dict.fromkeys(names, 3)
        assert node._expected_readers(made_up_spec([]), ["/ego/boxes"]) == {"/ego/boxes": 1}


@pytest.mark.parametrize("seed", range(2))
def test_boxes_are_joined_when_all_agents_have_labels(seed: int) -> None:
    data = made_up_agents().model_dump(mode="json")
    for agent, rate_hz in zip(data["agents"], (20, 10, None), strict=True):
        agent["annotation"]["rate_hz"] = rate_hz
    spec = SceneSpec.model_validate(data)
    sparse = [event for event in arriving(spec, seed) if event[0] != "car" or event[1] % 2 == 0]
    with started_node("joint", spec) as node:
        sent = play(node, spec, sparse)
    assert sent["finished"] == list(TICKS)
    expected = [join_boxes(AGENTS, {agent: boxes_of(agent, tick) for agent in AGENTS}).rows for tick in (0, 2)]
    assert [table_from_message(message).tobytes() for message in sent["/world/boxes"]] == [
        rows.tobytes() for rows in expected
    ]
    assert joint_boxes_topic(spec) == Topic("/world/boxes", "sensor_msgs/msg/PointCloud2", 2)
