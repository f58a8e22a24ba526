"""The world node's topics for displays: markers, the path of the ego, weather and events, made while subscribed to."""

from simbev_ros.geometry.transforms import quaternion_from_rpy
from simbev_ros.msgs import topics
from simbev_ros.msgs.displays.box_markers import world_markers
from simbev_ros.msgs.displays.ego_path import EgoPath, PathPose
from simbev_ros.msgs.displays.status import EVENT, WEATHER, status
from simbev_ros.msgs.displays.table_points import table_points
from simbev_ros.msgs.topic import Topic
from simbev_ros.msgs.world import event_record, position_ahead
from simbev_ros.nodes.graph_node import GraphNode
from simbev_ros.scene.spec import SceneSpec
from simbev_ros.scene.state import WorldState
from simbev_ros.sensors.mount import vector
from simbev_ros.types import Table


class WorldDisplays:
    """Publishes a scene's displays; its topics are advertised by the node."""

    def __init__(self, node: GraphNode, spec: SceneSpec, lamps: Table) -> None:
        """Start with an empty path.

        Args:
            node: The world node.
            spec: The scene.
            lamps: (L,) ``STREET_LIGHT_DTYPE``.
        """
        self._node, self._lamps, self._base_link_x_m = node, lamps, spec.base_link_x_m
        self._topics = {topic.name: topic for topic in topics.world_displays(spec)}
        self._path_topic: Topic = self._topics[topics.path_name(spec.rig.agent)]
        self._path = EgoPath()

    def publish(self, state: WorldState) -> None:
        """Publish what somebody looks at."""
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
        here = self._base_link(state)
        publish(self._path_topic, self._path.message, here)
        self._path.add(here)

    def _base_link(self, state: WorldState) -> PathPose:
        position_m = position_ahead(state.ego, self._base_link_x_m)
        xyzw = quaternion_from_rpy(vector(state.ego, "roll pitch yaw"))
        return PathPose(state.stamp_ns, position_m.tolist(), xyzw.tolist())
