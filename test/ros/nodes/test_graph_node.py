"""Nodes read sections of the configuration from JSON parameters, and log where the first malformed message fails."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import rclpy
from ros_domain import DOMAIN

from simbev_ros.config.rendering import Rendering
from simbev_ros.foundation.errors import InputError
from simbev_ros.ros.conventions.names import NodeName
from simbev_ros.ros.nodes.graph_node import GraphNode


@pytest.fixture
def make_node(tmp_path: Path) -> Iterator[Callable[[str], GraphNode]]:
    """Function that makes a node with a JSON text as its parameter ``rendering``."""
    nodes: list[GraphNode] = []

    def make(text: str) -> GraphNode:
        file = tmp_path / "parameters.yaml"
        file.write_text(f"camera: {{ros__parameters: {{rendering: '{text}'}}}}\n")
        rclpy.init(args=["--ros-args", "--params-file", str(file)], domain_id=DOMAIN)
        nodes.append(GraphNode(NodeName("camera")))
        return nodes[0]

    yield make
    for node in nodes:
        node.destroy_node()
    rclpy.shutdown()


def test_a_section_is_validated_and_filled_with_defaults(make_node: Callable[[str], GraphNode]) -> None:
    node = make_node('{"gpus": [3]}')
    assert node.declare_section("rendering", Rendering) == Rendering(gpus=(3,))
    description = node.describe_parameter("rendering")
    assert description.read_only and "section rendering, as JSON" in description.description


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('{"quality": "best"}', r"^parameter rendering\.quality: Input should be 'low', 'medium' or 'high'"),
        ('{"sharpness": 1}', r"^parameter rendering\.sharpness: Extra inputs are not permitted"),
        ("medium", "^parameter rendering: Invalid JSON"),
    ],
)
def test_an_invalid_section_is_refused_with_parameter_and_field(
    make_node: Callable[[str], GraphNode], text: str, message: str
) -> None:
    with pytest.raises(InputError, match=message):
        make_node(text).declare_section("rendering", Rendering)


def test_the_first_malformed_message_on_a_topic_is_logged_with_its_traceback(
    make_node: Callable[[str], GraphNode], capfd: pytest.CaptureFixture[str]
) -> None:
    node = make_node("{}")

    def read_length(message: object) -> int:
        return len(message.data)  # type: ignore[attr-defined]

    for _ in range(2):
        assert node.read("/points", read_length, 5) is None
    log = "".join(capfd.readouterr())
    assert log.count("ignored messages on /points: 'int' object has no attribute 'data'") == 1
    assert log.count("in read_length") == 1 and "Traceback" in log
    assert node.meter.read()["ignored"] == 2
