"""An annotator that receives a recorded scene's topics publishes the recorded labels again, byte for byte."""

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from itertools import groupby
from pathlib import Path

import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile
from ros_domain import DOMAIN
from std_msgs.msg import Header
from subscriber import outside_node
from waiting import PATIENCE_S

from simbev_ros.dataset.index import read_index
from simbev_ros.dataset.plan import Plan
from simbev_ros.production.scene_log import scene_logs
from simbev_ros.recording.canonical import canonical_cdr
from simbev_ros.recording.reader import SceneBag
from simbev_ros.ros.graph.environment import graph_environment
from simbev_ros.ros.msgs import topics
from simbev_ros.ros.msgs.annotation_topics import annotation_topics, annotator_inputs
from simbev_ros.ros.msgs.message_types import message_class
from simbev_ros.schema.scene.agents import agent_view

pytestmark = pytest.mark.graph

DEEP = QoSProfile(depth=200)
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


@contextmanager
def annotator() -> Iterator[None]:
    """Run the node in a process of its own, as a user would start it."""
    words = [
        sys.executable,
        "-m",
        "simbev_ros.ros.nodes.main",
        "annotator:annotator",
        "--ros-args",
        "-p",
        "recorded:=true",
    ]
    process = subprocess.Popen(words, env={**os.environ, **graph_environment(DOMAIN)}, start_new_session=True)
    try:
        yield
    finally:
        process.terminate()
        assert process.wait(PATIENCE_S) == 0


def holds(messages: list[bytes], count: int) -> bool:
    return len(messages) == count


@pytest.mark.slow
def test_labels_of_a_replayed_bag_equal_the_recorded_ones(recorded: Path) -> None:
    with SceneBag(recorded) as bag:
        assert bag.spec is not None
        messages = list(bag.messages())
        labels = {topic.name: topic.type for topic in annotation_topics(agent_view(bag.spec)).recorded}
        sensors = annotator_inputs(agent_view(bag.spec), compressed_images=True)
    read = {topics.ACTORS, topics.SIGNALS, topics.WEATHER, *(topic.name for topic in sensors.values())}
    assert len(read) == 6
    got: dict[str, list[bytes]] = {name: [] for name in labels}
    with annotator(), outside_node("player") as (node, spin_until):
        for name, kind in labels.items():
            node.create_subscription(message_class(kind), name, got[name].append, DEEP, raw=True)
        types = {message.topic: message.type_name for message in messages}
        publishers = {name: node.create_publisher(message_class(types[name]), name, DEEP) for name in read}
        scene = node.create_publisher(message_class(types[topics.SCENE]), topics.SCENE, LATCHED)
        scene.publish(next(message.data for message in messages if message.topic == topics.SCENE))
        ready: list[Header] = []
        node.create_subscription(Header, topics.READY, ready.append, LATCHED)
        spin_until(lambda: bool(ready))  # the scene is loaded, and all readers and writers are connected
        moving = [message for message in messages if message.topic in read]
        for number, (_, tick) in enumerate(groupby(moving, key=lambda message: message.stamp_ns), start=1):
            for message in tick:
                publishers[message.topic].publish(message.data)
            spin_until(partial(holds, got["/ego/boxes"], number))
        assert number == 10
        recorded_labels = {name: [each.data for each in messages if each.topic == name] for name in labels}
        spin_until(lambda: all(holds(got[name], len(data)) for name, data in recorded_labels.items()))
    for name, kind in labels.items():
        assert [canonical_cdr(payload, kind) for payload in got[name]] == recorded_labels[name], name


def test_what_run_records_is_a_dataset_with_plan_index_and_logs(recorded: Path) -> None:
    folder = recorded.parents[2]
    (row,) = read_index(folder)
    assert row["name"] == recorded.name and row["complete"]
    assert [entry.name for entry in Plan.load(folder).scenes] == [recorded.name]
    assert (folder / "plan.json").exists()
    (log,) = scene_logs(folder, recorded.name)
    assert "duration after tick" in log.read_text()
