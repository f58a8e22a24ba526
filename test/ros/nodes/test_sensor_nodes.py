"""Every kind of sensor has a node that advertises and publishes the manifest's topics without naming them itself."""

import ast
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import rclpy
from made_up_scene import made_up_spec
from ros_domain import DOMAIN
from several_agents import car, with_agents
from synthetic_world import actor, box_model, world

from simbev_ros.config.rig import SENSOR_KINDS
from simbev_ros.foundation.semantics import Tag
from simbev_ros.ros import nodes
from simbev_ros.ros.conventions.names import NodeName
from simbev_ros.ros.msgs.sensor_topics import sensor_topics
from simbev_ros.ros.msgs.topics import manifest
from simbev_ros.ros.nodes.main import KINDS, node_class
from simbev_ros.ros.nodes.participant import Participant
from simbev_ros.ros.nodes.surroundings import Surroundings
from simbev_ros.schema.scene.agents import agent_views
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import EGO_ID

CAR = box_model(Tag.CAR, (4.0, 2.0, 1.5))
LIGHT_KINDS = [kind for kind in SENSOR_KINDS if kind not in ("camera", "lidar", "radar")]
"""Kinds that need no meshes; the other nodes have tests of their own here and in test/graph."""


@pytest.fixture
def context() -> Iterator[None]:
    rclpy.init(domain_id=DOMAIN)
    yield
    rclpy.shutdown()


def spec_with(kind: str) -> SceneSpec:
    """A scene with two agents that have one sensor of a kind each."""
    options = {"velocity": {}, "extended_fix": True} if kind == "gnss" else {}
    sensors = [{"type": kind, "name": "some", **options}]
    return with_agents(made_up_spec(sensors), car("car", 1, sensors))


def start_node(kind: str, monkeypatch: pytest.MonkeyPatch) -> tuple[Any, list[str]]:
    """Start the scene of ``spec_with`` on a node, without meshes and OpenGL; return it and its recordable topics."""
    made_class = node_class(kind)
    monkeypatch.setattr(
        Surroundings, "load", lambda *_: SimpleNamespace(set_lights=print, set_appearance=print, set_agents=print)
    )
    if kind == "camera":
        module = __import__(made_class.__module__, fromlist=["open_context"])
        monkeypatch.setattr(module, "open_context", lambda *_: SimpleNamespace(release=lambda: None))
    node: Any = made_class(NodeName(kind))
    return node, node.start_scene(spec_with(kind))


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_has_a_node(kind: str) -> None:
    assert node_class(kind).__module__ == f"simbev_ros.ros.nodes.{kind}_node"
    assert kind not in SENSOR_KINDS or issubclass(node_class(kind), Participant)


@pytest.mark.usefixtures("context")
@pytest.mark.parametrize("kind", SENSOR_KINDS)
def test_a_node_advertises_the_topics_of_the_manifest(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    node, recorded = start_node(kind, monkeypatch)
    views = agent_views(spec_with(kind))
    expected = [topic for view in views for topic in sensor_topics(view, compressed_images=True)]
    advertised = dict(node.get_publisher_names_and_types_by_node(kind, "/"))
    node.close()
    node.destroy_node()
    assert recorded == [topic.name for topic in expected]
    assert {topic.name: [topic.type] for topic in expected}.items() <= advertised.items()


@pytest.mark.usefixtures("context")
@pytest.mark.parametrize("kind", LIGHT_KINDS)
def test_a_node_publishes_on_each_of_its_topics(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    node, recorded = start_node(kind, monkeypatch)
    sent: list[str] = []
    monkeypatch.setattr(node, "publish", lambda name, _: sent.append(name))
    for tick in (-1, 0):
        cars = [actor(CAR, id=EGO_ID), actor(CAR, id=EGO_ID + 1, y=5.0)]
        node.process(spec_with(kind), world(*cars, tick=tick))
        assert sent == (recorded if tick == 0 else [])
    node.destroy_node()


def test_no_node_names_a_topic_or_type_of_the_manifest() -> None:
    spec = made_up_spec([{"type": kind, "name": kind} for kind in SENSOR_KINDS])
    known = [topic for form in (False, True) for topic in manifest(spec, compressed_images=form)]
    tails = {topic.name.split("/", depth)[-1] for topic in known for depth in (1, 2, 3)} - {""}
    forbidden = {*tails, *(topic.type for topic in known)}
    found = [
        f"{path.name}:{node.lineno}: {node.value!r}"
        for path in sorted(Path(nodes.__file__).parent.glob("*.py"))
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and node.value.strip("/") in forbidden
    ]
    assert found == []
