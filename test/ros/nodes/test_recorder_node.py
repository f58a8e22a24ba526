"""The recorder node: the bag of a drive is closed once the last score has arrived, however late that is."""

import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import rclpy
from drive_cases import spec
from rclpy.serialization import serialize_message
from ros_domain import DOMAIN
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String

from simbev_ros.recording.canonical import canonical_cdr
from simbev_ros.recording.reader import SceneBag
from simbev_ros.ros.conventions.names import NodeName
from simbev_ros.ros.msgs import topics
from simbev_ros.ros.msgs.stamps import time_message
from simbev_ros.ros.msgs.topic import Topic
from simbev_ros.ros.msgs.world import record_message
from simbev_ros.ros.nodes.recorder_node import RecorderNode
from simbev_ros.scene.ending import SceneEnd

SCENE = spec()
LAST = 2


@pytest.fixture
def recorder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """A recorder of the clock and the referee's topics in a drive of three ticks."""
    recorded = Topic(topics.CLOCK, "rosgraph_msgs/msg/Clock"), *topics.referee_topics(SCENE)
    monkeypatch.setattr(topics, "manifest", lambda *_, **__: recorded)
    rclpy.init(args=["--ros-args", "-p", f"dataset:={tmp_path}"], domain_id=DOMAIN)
    made: Any = RecorderNode(NodeName("recorder"))
    made.read_end = lambda message: SceneEnd(scene=SCENE.name, tick=LAST, reason="goal")
    text = SCENE.model_dump_json()
    made._on_scene(text, serialize_message(String(data=text)))
    yield made
    made.close()
    made.destroy_node()
    rclpy.shutdown()


def receive(recorder: Any, topic: str, tick: int, message: Any) -> None:
    payload = canonical_cdr(serialize_message(message), recorder._manifest[topic].type)
    recorder._record(topic, SCENE.stamp_ns(tick), payload)


@pytest.mark.parametrize("events", [0, 1])
def test_a_score_and_infractions_after_the_last_tick_close_the_bag(recorder: Any, tmp_path: Path, events: int) -> None:
    recorder._on_end(String())
    for tick in range(LAST + 1):
        receive(recorder, topics.CLOCK, tick, Clock(clock=time_message(SCENE.stamp_ns(tick))))
    assert recorder._writer is not None
    score = record_message({"infractions": {"standstill": events} if events else {}}, SCENE.stamp_ns(LAST))
    receive(recorder, topics.DRIVE_SCORE, LAST, score)
    receive(
        recorder, topics.DRIVE_SCORE, 0, record_message({"infractions": {}}, SCENE.stamp_ns(0))
    )  # from another node
    if events:
        assert recorder._writer is not None
        receive(recorder, topics.DRIVE_EVENTS, LAST, record_message({"kind": "standstill"}, SCENE.stamp_ns(LAST)))
    assert recorder._writer is None
    (path,) = {each.parent for each in tmp_path.rglob("*.mcap")}
    with SceneBag(path) as bag:
        assert bag.custom_data["complete"] == "true"
        assert json.loads(bag.custom_data["recorded"])["/drive/events"] == events


@pytest.mark.parametrize("count", [math.inf, math.nan, -1, "many"])
def test_an_impossible_number_of_infractions_is_not_announced(recorder: Any, count: object) -> None:
    recorder._on_end(String())
    for tick in range(LAST + 1):
        receive(recorder, topics.CLOCK, tick, Clock(clock=time_message(SCENE.stamp_ns(tick))))
    score = record_message({"infractions": {"standstill": count}}, SCENE.stamp_ns(LAST))
    receive(recorder, topics.DRIVE_SCORE, LAST, score)
    assert recorder._writer is None
    assert recorder._accounting.report().topics[topics.DRIVE_EVENTS].expected == 0
