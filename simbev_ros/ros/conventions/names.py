"""The border between names in a graph and names in ROS, which differ if the graph has a namespace.

Everything but this module uses the names of a graph without a namespace, such as ``/ego/lidar/points``: manifests,
bags, configurations, messages. A ``NamespacedNode`` puts them below the namespace of its graph when it creates
something. ROS applies its remapping rules after that, as for every node.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from rclpy.node import Node

from simbev_ros.ros.msgs import topics

ROOT = ""
"""The namespace of a graph that has none."""

_OF_ALL_GRAPHS = (topics.DIAGNOSTICS, "/rosout", "/parameter_events")
"""Topics that all nodes of a domain share, by ROS's own convention."""


def ros_name(name: str, namespace: str) -> str:
    """Name in ROS of a topic or service.

    Args:
        name: Name in the graph.
        namespace: Namespace of the graph, such as ``/sim1``, or ``ROOT``.
    """
    return name if name in _OF_ALL_GRAPHS or not name.startswith("/") else f"{namespace}{name}"


def graph_name(name: str, namespace: str) -> str | None:
    """Name in a graph of a topic or service; None if it does not belong to the graph.

    Args:
        name: Name in ROS.
        namespace: Namespace of the graph, or ``ROOT``.
    """
    if name in _OF_ALL_GRAPHS:
        return name
    return name.removeprefix(namespace) if name.startswith(f"{namespace}/") else None


@dataclass(frozen=True, slots=True)
class NodeName:
    """Name of a node of a graph.

    Attributes:
        name: Name within the graph, which is unique there.
        agent: The agent that the node belongs to; empty: the node belongs to the graph as a whole.
        graph: Namespace of the graph.
    """

    name: str
    agent: str = ""
    graph: str = ROOT

    @classmethod
    def parse(cls, path: str, graph: str = ROOT) -> "NodeName":
        """The name in ``name`` or ``agent/name``."""
        agent, _, name = path.rpartition("/")
        return cls(name, agent, graph)

    @property
    def path(self) -> str:
        """The name with the agent's, as ``parse`` takes it."""
        return "/".join(filter(None, (self.agent, self.name)))

    @property
    def namespace(self) -> str:
        """Namespace of the node in ROS."""
        return "/".join(filter(None, (self.graph, self.agent))) or "/"

    @property
    def full(self) -> str:
        """Fully qualified name in ROS."""
        return f"{self.graph}/{self.path}"


def logger_name(name: str) -> str:
    """Name of the node that a logger belongs to: rcl puts its namespace before it, with dots."""
    return name.rpartition(".")[2]


class NamespacedNode(Node):
    """A node that takes names in its graph wherever rclpy takes names of topics and services.

    Args:
        name: The node's name.
        options: Further options of ``rclpy.node.Node``.
    """

    def __init__(self, name: NodeName, **options: Any) -> None:
        self.graph_namespace = name.graph  # first, as rclpy's constructor creates some things
        super().__init__(name.name, namespace=name.namespace, **options)

    def create_publisher(self, msg_type: Any, topic: str, *args: Any, **kwargs: Any) -> Any:
        """Create a publisher for a topic of the graph."""
        return super().create_publisher(msg_type, ros_name(topic, self.graph_namespace), *args, **kwargs)

    def create_subscription(self, msg_type: Any, topic: str, *args: Any, **kwargs: Any) -> Any:
        """Create a subscription to a topic of the graph."""
        return super().create_subscription(msg_type, ros_name(topic, self.graph_namespace), *args, **kwargs)

    def create_service(self, srv_type: Any, srv_name: str, *args: Any, **kwargs: Any) -> Any:
        """Create a service of the graph."""
        return super().create_service(srv_type, ros_name(srv_name, self.graph_namespace), *args, **kwargs)

    def create_client(self, srv_type: Any, srv_name: str, *args: Any, **kwargs: Any) -> Any:
        """Create a client of a service of the graph."""
        return super().create_client(srv_type, ros_name(srv_name, self.graph_namespace), *args, **kwargs)

    def get_publishers_info_by_topic(self, topic_name: str, *values: Any) -> Any:
        """Describe the publishers of a topic of the graph."""
        return super().get_publishers_info_by_topic(ros_name(topic_name, self.graph_namespace), *values)

    def get_subscriptions_info_by_topic(self, topic_name: str, *values: Any) -> Any:
        """Describe the subscriptions to a topic of the graph."""
        return super().get_subscriptions_info_by_topic(ros_name(topic_name, self.graph_namespace), *values)

    def count_publishers(self, topic_name: str) -> int:
        """Count the publishers of a topic of the graph."""
        return int(super().count_publishers(ros_name(topic_name, self.graph_namespace)))

    def graph_topics(self) -> Iterable[tuple[str, list[str]]]:
        """Names in the graph, and types, of all topics that the graph can see."""
        for name, types in self.get_topic_names_and_types():
            if (own := graph_name(name, self.graph_namespace)) is not None:
                yield own, types
