"""What the transcript of the ros2 command line shows is still so: nodes, topics, types, QoS, parameters."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml
from display_topics import display_topics
from made_up_scene import made_up_spec

from simbev_ros.config.load import load_scenario
from simbev_ros.ros.graph.monitor import SUPERVISOR
from simbev_ros.ros.graph.plan import plan_processes
from simbev_ros.ros.msgs import topics
from simbev_ros.ros.msgs.qos import qos_of
from simbev_ros.ros.msgs.topic import Topic

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/guide/ros.md").read_text(encoding="utf-8")
SCENARIO = load_scenario(ROOT / "config/autoware/simbev.yaml")
SPEC = made_up_spec([sensor.model_dump() for sensor in SCENARIO.rig.sensors])
ANSWERS = dict(re.findall(r"^```console\n\$ (ros2 [^\n]+)\n(.*?)^```$", PAGE, re.DOTALL | re.MULTILINE))
WITHOUT_MANIFEST = {
    topics.DIAGNOSTICS: "diagnostic_msgs/msg/DiagnosticArray",
    topics.READY: "std_msgs/msg/Header",
}
OF_ALL_NODES = {"start_type_description_service", "use_sim_time", "reliable", "serves"}
"""Parameters that ROS adds to each node, or that nodes have which are started without them."""


def answer(command: str) -> str:
    """What a command printed, found by the beginning of the command."""
    (found,) = (text for asked, text in ANSWERS.items() if asked.startswith(f"ros2 {command}"))
    return found


def known() -> dict[str, Topic]:
    """All topics of the graph, by name."""
    found = [topic for form in (True, False) for topic in topics.manifest(SPEC, compressed_images=form)]
    found += [topics.end_topic(), *display_topics(SPEC)]
    return {topic.name: topic for topic in found}


def typed_topics() -> Iterator[tuple[str, str]]:
    """Every topic in the transcript with its type."""
    yield from re.findall(r"^(/\S+) \[(\S+/msg/\S+)\]$", answer("topic list"), re.MULTILINE)


def planned_nodes() -> set[str]:
    """Full names of the graph's nodes on two cores."""
    plan = plan_processes(SCENARIO, 1, live=True, dataset=None, cores=2)
    return {node.ros_name("").full for process in plan for node in process} | {f"/{SUPERVISOR}"}


def test_the_transcript_is_of_the_shipped_configuration() -> None:
    assert "./simbev run config/autoware/simbev.yaml --live\n" in PAGE


def test_all_nodes_are_listed() -> None:
    assert set(answer("node list").split()) == planned_nodes()


@pytest.mark.parametrize(("name", "kind"), sorted(set(typed_topics())))
def test_topics_have_the_types_of_the_manifest(name: str, kind: str) -> None:
    assert (WITHOUT_MANIFEST.get(name) or known()[name].type) == kind


def test_a_publisher_has_the_qos_of_its_topic() -> None:
    (name,) = (asked.split()[-1] for asked in ANSWERS if asked.startswith("ros2 topic info"))
    text, topic = answer("topic info"), known()[name]
    reliable = SCENARIO.graph.live_reliability == "reliable"
    profile = qos_of(topic, live=True, reliable=reliable)
    assert f"Type: {topic.type}\n" in text
    assert f"Reliability: {profile.reliability.upper()}\n" in text
    assert f"Durability: {profile.durability.upper()}\n" in text


def test_parameters_are_those_of_the_plan() -> None:
    dumped = yaml.safe_load(answer("param dump"))["/world"]["ros__parameters"]
    (world, *_), *_ = plan_processes(SCENARIO, 1, live=True, dataset=None, cores=2)
    assert dumped == {name: dumped[name] for name in OF_ALL_NODES & dumped.keys()} | dict(world.parameters)
