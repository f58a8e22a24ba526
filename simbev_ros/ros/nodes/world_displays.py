"""The world node's topics for displays: markers, agents' paths, weather and events, made while subscribed to."""

from collections.abc import Sequence

from nav_msgs.msg import Odometry

from simbev_ros.drawing.displays.box_markers import world_markers
from simbev_ros.drawing.displays.ego_path import EgoPath, PathPose
from simbev_ros.drawing.displays.status import EVENT, WEATHER, status
from simbev_ros.drawing.displays.table_points import table_points
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
        self._topics = {topic.name: topic for topic in topics.world_displays(spec)}
        self._paths = [(self._topics[topics.path_name(rig.agent)], EgoPath()) for rig in spec.rigs]

    def publish(self, state: WorldState, odometries: Sequence[Odometry]) -> None:
        """Publish the displays that have subscribers.

        Args:
            state: The world at this tick.
            odometries: True odometry of each agent at this tick.
        """
        publish = self._node.publish_display
        tables, weather = (state.actors, state.signals, self._lamps), state.weather.model_dump()
        publish(self._topics[topics.WORLD_MARKERS], world_markers, *tables, state.stamp_ns)
        publish(self._topics[topics.WEATHER_STATUS], status, WEATHER, weather, state.stamp_ns)
        typed = {topics.ACTORS: state.actors, topics.SIGNALS: state.signals, topics.WEATHER: weather}
        for source, content in typed.items():
            self._node.publish_typed(source, content, state.stamp_ns)
        for name, table in zip((topics.ACTOR_POINTS, topics.SIGNAL_POINTS, topics.LIGHT_POINTS), tables, strict=True):
            publish(self._topics[name], table_points, table, state.stamp_ns)
        for event in state.events:
            record = event_record(event, state)
            publish(self._topics[topics.EVENT_STATUS], status, EVENT, record, state.stamp_ns)
            self._node.publish_typed(topics.EVENTS, record, state.stamp_ns)
        for (topic, path), odometry in zip(self._paths, odometries, strict=True):
            here = PathPose.of_odometry(odometry, state.stamp_ns)
            publish(topic, path.message, here)
            path.add(here)
