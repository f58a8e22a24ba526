"""Answers of a stack are found whatever else a stranger publishes on their topics."""

from types import SimpleNamespace
from typing import Any

import pytest
from rclpy.qos import QoSProfile

from simbev_ros.ros.nodes.answer_topics import AnswerTopics

TABLE, DETECTIONS, TEXT = "sensor_msgs/msg/PointCloud2", "vision_msgs/msg/Detection3DArray", "std_msgs/msg/String"


class FakeNode:
    """Knows the publishers of each topic, and counts subscriptions."""

    def __init__(self) -> None:
        self.types: dict[str, list[str]] = {}
        self.subscribed: list[tuple[str, str]] = []

    def get_publishers_info_by_topic(self, name: str) -> list[Any]:
        return [SimpleNamespace(topic_type=each, qos_profile=QoSProfile(depth=1)) for each in self.types.get(name, ())]

    def create_subscription(self, kind: type, name: str, *_: object) -> object:
        self.subscribed.append((name, kind.__name__))
        return object()


@pytest.fixture
def node() -> FakeNode:
    return FakeNode()


@pytest.fixture
def answers(node: FakeNode) -> AnswerTopics:
    return AnswerTopics(node, "/boxes", "/grids", lambda _: None, lambda *_: None, lambda *_: None)  # type: ignore[arg-type]


def test_a_stranger_of_another_type_is_named_and_the_stack_is_still_found(
    node: FakeNode, answers: AnswerTopics
) -> None:
    node.types = {"/boxes": [TEXT]}
    assert answers.subscribe_to_new() == [] and not answers.found
    assert str(answers.refused["/boxes"]).startswith(f"/boxes: is a {TEXT}; allowed: {TABLE}")
    node.types = {"/boxes": [TEXT, TABLE]}
    assert answers.subscribe_to_new() == ["/boxes"]
    assert node.subscribed == [("/boxes", "PointCloud2")]


def test_a_second_form_of_scores_is_refused(node: FakeNode, answers: AnswerTopics) -> None:
    node.types = {"/grids": ["sensor_msgs/msg/Image"]}
    assert answers.subscribe_to_new() == ["/grids"]
    node.types["/grids/road"] = ["nav_msgs/msg/OccupancyGrid"]
    assert answers.subscribe_to_new() == []
    assert (
        str(answers.refused["/grids/road"]) == "there are scores on /grids/road and /grids; allowed is one or the other"
    )
