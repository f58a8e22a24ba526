"""Nodes of the graph that run in the test's own process."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest
import rclpy
from ros_domain import DOMAIN

from simbev_ros.ros.conventions.names import NodeName
from simbev_ros.ros.nodes.main import node_class
from simbev_ros.schema.scene.spec import SceneSpec


@contextmanager
def started_node(kind: str, spec: SceneSpec, **parameters: object) -> Iterator[Any]:
    """A node with ROS parameters that has started a scene; ``topics`` are the names of those it may record."""
    words = [word for name, value in parameters.items() for word in ("-p", f"{name}:={value}")]
    rclpy.init(args=["--ros-args", *words] if words else [], domain_id=DOMAIN)
    made: Any = None
    try:
        made = node_class(kind)(NodeName(kind))
        made.topics = made.start_scene(spec)
        yield made
    finally:
        if made is not None:
            made.close()
            made.destroy_node()
        rclpy.shutdown()


@contextmanager
def collecting_node(kind: str, spec: SceneSpec, monkeypatch: pytest.MonkeyPatch, *arguments: str) -> Iterator[Any]:
    """A node of the ego, with arguments in ROS's form, that has started a scene.

    It collects messages in ``sent`` and finished ticks in ``reported``; ``recorded_topics`` are those it may record.
    """
    rclpy.init(args=["--ros-args", *arguments] if arguments else None, domain_id=DOMAIN)
    made: Any = node_class(kind)(NodeName(kind, "ego"))
    try:
        made.sent, made.reported = [], []
        made.recorded_topics = made.start_scene(spec)
        monkeypatch.setattr(made, "publish", lambda name, message: made.sent.append((name, message)))
        monkeypatch.setattr(made, "report_finished", lambda _, tick: made.reported.append(tick))
        yield made
    finally:
        made.close()
        made.destroy_node()
        rclpy.shutdown()
