"""The world node's topics for displays: markers, agents' paths, weather and events, made while subscribed to."""

from collections.abc import Sequence
from typing import Any

from nav_msgs.msg import Odometry

from simbev_ros.drawing.displays.ego_path import EgoPath, PathPose
from simbev_ros.foundation.types import Table
from simbev_ros.ros.msgs import topics
from simbev_ros.ros.msgs.world import event_record
from simbev_ros.ros.nodes.graph_node import GraphNode
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import WorldState


class WorldDisplays:
    """Publishes a scene's displays; its topics are advertised by the node."""

    def __init__(self, node: GraphNode, spec: SceneSpec, lamps: Table) -> None:
        """Start with empty paths.

        Args:
            node: The world node.
            spec: The scene.
            lamps: (L,) ``STREET_LIGHT_DTYPE``.
        """
        self._node, self._lamps = node, lamps
        self._paths = [(topics.odometry_name(agent.name), EgoPath()) for agent in spec.agents]

    def publish(self, state: WorldState, odometries: Sequence[Odometry]) -> None:
        """Publish the displays and typed messages that have subscribers.

        Args:
            state: The world at this tick.
            odometries: True odometry of each agent at this tick.
        """
        contents: dict[str, Any] = {
            topics.ACTORS: state.actors,
            topics.SIGNALS: state.signals,
            topics.LIGHTS: self._lamps,
            topics.WEATHER: state.weather.model_dump(),
        }
        for (odometry_topic, path), odometry in zip(self._paths, odometries, strict=True):
            here = PathPose.of_odometry(odometry, state.stamp_ns)
            contents[odometry_topic] = path.until(here)
            path.add(here)
        self._node.publish_derived(state.stamp_ns, contents)
        for event in state.events:
            self._node.publish_derived(state.stamp_ns, {topics.EVENTS: event_record(event, state)})
