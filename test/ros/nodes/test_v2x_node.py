"""The V2X node: what each agent sends and what arrives at each of them, as tables and as detections."""

from collections import defaultdict
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from display_topics import display_topics
from made_up_scene import labeled_at, made_up_spec
from rclpy.serialization import serialize_message
from several_agents import made_up_agents
from started_nodes import started_node
from synthetic_world import actor, cart_model, world

from simbev_ros.drawing.displays.detections import DETECTIONS_3D
from simbev_ros.foundation.types import Table
from simbev_ros.ros.msgs.displays import scene_displays
from simbev_ros.ros.msgs.joint_topics import joint_inputs
from simbev_ros.ros.msgs.tables import message_from_table, table_from_message
from simbev_ros.ros.msgs.topics import manifest
from simbev_ros.schema.boxes import blank_boxes
from simbev_ros.schema.messages.message_types import types_with
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import EGO_ID, WorldState
from simbev_ros.simulation.annotation.v2x import V2xNetwork

AGENTS = ("ego", "car", "rsu")
PARTNERS = ("ego", "car")
TICKS = range(-1, 6)


def scene() -> SceneSpec:
    v2x = {"range_m": 100, "rate_hz": 10, "latency_s": 0.05, "agents": PARTNERS}
    return SceneSpec.model_validate(made_up_agents().model_dump(mode="json") | {"v2x": v2x})


def state_at(tick: int) -> WorldState:
    ego, other = (actor(cart_model(), id=EGO_ID + k, x=20.0 * k) for k in (0, 2))
    return replace(world(ego, other, tick=tick), ego_id=EGO_ID, stamp_ns=scene().stamp_ns(tick))


def boxes_of(tick: int) -> Table:
    rows = blank_boxes(2)
    rows["id"], rows["x"], rows["lidar_points"] = (5, 8), tick, (1, 0)
    return rows


def network_of(spec: SceneSpec) -> V2xNetwork:
    assert spec.v2x is not None
    return V2xNetwork(spec, spec.v2x)


def play(node: Any, spec: SceneSpec, readers: int = 0) -> dict[str, list[Any]]:
    """What the node publishes by topic, and the ticks that it reports."""
    sent: dict[str, list[Any]] = defaultdict(list)
    node.spec, node._joined._is_sent, node.reader_count = spec, lambda _: True, lambda _: readers
    node.publish = lambda name, message: sent[name].append(message)
    node.report_finished = lambda _, tick: sent["finished"].append(tick)
    for tick in TICKS:
        node.process(spec, state_at(tick))
        node.finish(spec, state_at(tick))
        for name, topic in joint_inputs(spec).items() if tick >= 0 else ():
            if tick % topic.period_ticks:
                continue
            payload = serialize_message(message_from_table(boxes_of(tick), spec.stamp_ns(tick), "map"))
            node._joined._subscriptions[f"/{name}/boxes"].callback(payload)
    return dict(sent)


def test_messages_are_published_when_sent_and_at_every_tick_as_they_arrive() -> None:
    spec, network = scene(), network_of(scene())
    expected: dict[str, list[Table]] = defaultdict(list)
    for tick in TICKS[1:]:
        exchange = network.exchange(state_at(tick), dict.fromkeys(AGENTS, boxes_of(tick)))
        for name, rows in exchange.sent.items():
            expected[f"/v2x/{name}"].append(rows)
        for name, rows in exchange.arrived.items():
            expected[f"/{name}/v2x"].append(rows)
    with started_node("v2x", spec) as node:
        assert sorted(node.topics) == sorted(expected)
        found = play(node, spec)
    assert found.pop("finished") == list(TICKS)
    assert [len(found["/v2x/ego"]), len(found["/ego/v2x"])] == [3, 6]
    for name, messages in found.items():
        for message, rows in zip(messages, expected[name], strict=True):
            table = table_from_message(message)
            assert (table.dtype, table.tobytes()) == (rows.dtype, rows.tobytes())
            assert message.header.frame_id == "map"
    assert [len(table_from_message(message)) for message in found["/ego/v2x"]] == [0, 2, 0, 2, 0, 2]


def test_messages_do_not_depend_on_the_rate_of_labels_that_divides_theirs() -> None:
    slow = labeled_at(scene(), 10)
    assert {topic.period_ticks for topic in joint_inputs(slow).values()} == {2}
    with started_node("v2x", scene()) as node:
        every_tick = play(node, scene())
    with started_node("v2x", slow) as node:
        assert play(node, slow) == every_tick


def test_the_topics_are_those_of_the_manifest_and_of_the_displays() -> None:
    spec = scene()
    with started_node("v2x", spec) as node:
        topics = {topic.name: topic for topic in manifest(spec, compressed_images=True)}
        assert [topics[name].period_ticks for name in node.topics] == [2, 1, 2, 1]
        assert {name for name in topics if "v2x" in name} == {*node.topics}
    displays = {topic.name for topic in display_topics(spec) if "v2x" in topic.name}
    assert displays == {f"{name}/detections" for name in node.topics}


def test_messages_are_shown_as_detections_with_the_senders_among_them() -> None:
    sent = network_of(scene()).exchange(state_at(0), {}).sent
    display = next(each for each in scene_displays(scene()) if each.topic.name == "/v2x/ego/detections")
    payload = display.make(7, np.concatenate(list(sent.values())))
    found = types_with(DETECTIONS_3D).deserialize_cdr(payload, DETECTIONS_3D)
    assert [each.id for each in found.detections] == [str(EGO_ID), str(EGO_ID + 2)]
    assert [each.bbox.center.position.x for each in found.detections] == [0.0, 40.0]


def test_detections_are_published_while_somebody_subscribes(monkeypatch: pytest.MonkeyPatch) -> None:
    spec = scene()
    with started_node("v2x", spec) as node:
        monkeypatch.setattr(node, "_topic_publishers", dict.fromkeys(t.name for t in display_topics(spec)))
        assert len(play(node, spec, readers=1)["/v2x/ego/detections"]) == 3
        assert "/v2x/ego/detections" not in play(node, spec, readers=0)


@pytest.mark.parametrize("spec", [made_up_agents(), made_up_spec([])])
def test_a_scene_without_messages_is_finished_at_once(spec: SceneSpec) -> None:
    with started_node("v2x", spec) as node:
        assert node.topics == []
        assert play(node, spec) == {"finished": list(TICKS)}
