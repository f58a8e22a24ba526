"""The joint node: publishes one table of the boxes around all agents of a scene, with what each of them sees."""

from collections.abc import Mapping

from simbev_ros.foundation.types import Table
from simbev_ros.ros.msgs.joint_topics import JOINT_BOXES, joint_boxes_topic
from simbev_ros.ros.msgs.tables import message_from_table
from simbev_ros.ros.msgs.world import MAP_FRAME
from simbev_ros.ros.nodes.box_reader import BoxReader
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.simulation.annotation.boxes.joint import join_boxes


class JointNode(BoxReader):
    """Joins the boxes of all agents. In a scene with one agent it publishes nothing."""

    def start_scene(self, spec: SceneSpec) -> list[str]:
        """Subscribe to the boxes of all agents, and advertise the joint ones."""
        super().start_scene(spec)
        if (topic := joint_boxes_topic(spec)) is None:
            return []
        self._period_ticks = topic.period_ticks
        self.advertise(topic)
        return [topic.name]

    def process_boxes(self, spec: SceneSpec, state: WorldState, boxes: Mapping[str, Table]) -> None:
        """Publish the joint boxes of a tick at which all agents have labels."""
        if state.tick % self._period_ticks:
            return
        joint = join_boxes([agent.name for agent in spec.agents], boxes)
        for agent, reason in joint.refused.items():
            self.ignore(f"boxes of {agent}", ValueError(reason))
        self.publish(JOINT_BOXES, message_from_table(joint.rows, state.stamp_ns, MAP_FRAME))
