"""A stack that cooperates: it merges the boxes that the stacks of other agents have found into its own.

It runs until Ctrl-C, next to ``simbev run`` and the stacks of the other agents::

    python -m simbev_ros.reference_stack.cooperative --ros-args -p partners:=[/car_2/lidar/points]
"""

from collections.abc import Mapping
from functools import partial

import numpy as np
from sensor_msgs.msg import PointCloud2

from simbev_ros.reference_stack.arrays import Floats, Table
from simbev_ros.reference_stack.classes import load_kinds
from simbev_ros.reference_stack.fusion import fuse_boxes
from simbev_ros.reference_stack.grid import box_scores
from simbev_ros.reference_stack.messages import table_of
from simbev_ros.reference_stack.node import EVERY, ReferenceStack, run_until_signal
from simbev_ros.reference_stack.pipeline import BOX_DTYPE, Answer
from simbev_ros.reference_stack.scene import Scene, UsageError, read_scene

_MAP_FRAME = "map"


class CooperativeStack(ReferenceStack):
    """The reference stack of one agent, which waits at each tick for the boxes of the partners that answer to it.

    Further topics in: <agent>/prediction/boxes of each partner, which can be remapped: tables in the map frame, with
    the columns of its own boxes, one for each of the partner's clouds.

    Parameters:
        partners: Topics of the clouds that the partners answer to.

    Raises:
        UsageError: The list of partners is empty.
    """

    def __init__(self) -> None:
        super().__init__("cooperative_stack")
        self._partners = [str(topic) for topic in self.declare_parameter("partners", [""]).value if topic]
        if not self._partners:
            raise UsageError("partners: needs topics of the clouds of other agents, such as /car_2/lidar/points")
        self._partner_scenes: dict[str, Scene] = {}
        self._scene_of_answer: Scene | None = None
        for topic in self._partners:
            answers, receive = f"{_agent_of(topic)}/prediction/boxes", partial(self.add_input, topic)
            self.inputs.append(self.create_subscription(PointCloud2, answers, receive, EVERY))

    def start_scene(self, text: str) -> Scene:
        """Read when the partners' clouds are due, too."""
        self._partner_scenes = {topic: read_scene(text, topic) for topic in self._partners}
        self._scene_of_answer = super().start_scene(text)
        return self._scene_of_answer

    def due(self, stamp_ns: int) -> tuple[str, ...]:
        """The own cloud, and the answers of the partners."""
        answering = (topic for topic, scene in self._partner_scenes.items() if scene.has_cloud(stamp_ns))
        return (*super().due(stamp_ns), *answering)

    def complete(self, answer: Answer, messages: Mapping[str, PointCloud2], map_from_ego: Floats) -> Answer:
        """Merge the partners' boxes into the answer, and raise the scores of the cells that they cover."""
        assert self._scene_of_answer is not None
        found = [self._boxes_of(topic, messages[topic]) for topic in self._partners if topic in messages]
        boxes = fuse_boxes([answer.boxes, *found], map_from_ego)
        scores = box_scores(boxes, load_kinds(), self._scene_of_answer.grid, map_from_ego)
        return Answer(boxes, np.maximum(answer.scores, scores))

    def _boxes_of(self, topic: str, message: PointCloud2) -> Table:
        """Boxes of a partner; none if they are not as they must be, which is logged."""
        try:
            if message.header.frame_id != _MAP_FRAME:
                raise ValueError(f"its frame is {message.header.frame_id!r}; it must be {_MAP_FRAME}")
            return table_of(message, BOX_DTYPE)
        except ValueError as error:
            self.get_logger().error(f"boxes of {_agent_of(topic)}: {error}", throttle_duration_sec=10.0)
            return np.zeros(0, BOX_DTYPE)


def _agent_of(topic: str) -> str:
    """Name of the agent that this topic belongs to."""
    return topic.removeprefix("/").partition("/")[0]


if __name__ == "__main__":
    run_until_signal(CooperativeStack)
