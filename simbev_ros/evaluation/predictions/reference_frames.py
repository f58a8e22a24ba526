"""Coordinate frames of a scene, by their names in /tf and /tf_static.

From the calibrations and the poses of a scene's agents, ``ReferenceFrames`` computes the pose of each of their frames
in the map frame.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import NamedTuple, Self

from simbev_ros.dataset.calibration import Calibration
from simbev_ros.dataset.scene import Scene
from simbev_ros.evaluation.predictions.predicted_boxes import MAP_FRAME
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.geometry.transforms import SENSOR_FROM_OPTICAL
from simbev_ros.foundation.types import Float64Array
from simbev_ros.scene.frames import base_link_frame, ego_frame, ego_from_base_link
from simbev_ros.schema.scene.agents import AgentView


class AgentPoses(NamedTuple):
    """Coordinate frames and poses of an agent.

    Attributes:
        view: The scene as the agent sees it.
        calibration: Calibration of its sensors, by name.
        map_from_ego: Gives the (4, 4) pose of the agent at a tick.
    """

    view: AgentView
    calibration: Mapping[str, Calibration]
    map_from_ego: Callable[[int], Float64Array]

    def ego_from_frames(self) -> Iterator[tuple[str, Float64Array | None]]:
        """Name and (4, 4) pose in the ego frame of each of the agent's frames; None: it is the ego frame."""
        agent = self.view.agent
        if ego_frame(self.view) != base_link_frame(agent):
            yield base_link_frame(agent), ego_from_base_link(self.view)
        yield ego_frame(self.view), None
        for name, each in self.calibration.items():
            if not each.sensor.has_frame:
                continue
            yield f"{agent}/{name}", each.ego_from_sensor
            if each.camera is not None:
                yield f"{agent}/{name}_optical", each.ego_from_sensor @ SENSOR_FROM_OPTICAL


class ReferenceFrames:
    """Poses in the map frame, by tick and name of the coordinate frame, for ``predicted_boxes.boxes_in_map``.

    Args:
        agents: Agents of one scene; answers may be in the frames of any.

    Attributes:
        names: ``map``, and for each agent ``<agent>/base_link``, ``<agent>/<sensor>`` and
            ``<agent>/<camera>_optical``; and ``<agent>/footprint``, the ego frame, if base_link is at the rear axle.
    """

    def __init__(self, agents: Iterable[AgentPoses]) -> None:
        self._scene = ""
        self._frames: dict[str, tuple[AgentPoses, Float64Array | None]] = {}
        for agent in agents:
            self._scene = agent.view.scene.name
            self._frames |= {name: (agent, pose) for name, pose in agent.ego_from_frames()}

    @classmethod
    def from_scene(cls, scene: Scene) -> Self:
        """Coordinate frames of all agents of a recorded scene, those of the scene's own agent first."""
        others = (scene.of_agent(name) for name in scene.agents if name != scene.agent)
        return cls(map(_recorded_poses, (scene, *others)))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all coordinate frames."""
        return (MAP_FRAME, *self._frames)

    def agents_of(self, frame_ids: Iterable[str]) -> set[str]:
        """Names of the agents that coordinate frames belong to; the map and unknown frames belong to none."""
        return {self._frames[name][0].view.agent for name in frame_ids if name in self._frames}

    def __call__(self, tick: int, frame_id: str) -> Float64Array:
        """(4, 4) map from a coordinate frame at a tick.

        Raises:
            InputError: There is no such coordinate frame.
        """
        if frame_id not in self._frames:
            raise InputError(
                f"frame_id: there is no {frame_id!r} in scene {self._scene}; allowed: {', '.join(self.names)}"
            )
        agent, ego_from_frame = self._frames[frame_id]
        map_from_ego = agent.map_from_ego(tick)
        return map_from_ego if ego_from_frame is None else map_from_ego @ ego_from_frame


def _recorded_poses(scene: Scene) -> AgentPoses:
    """Poses of the agent for which a recorded scene is read."""
    return AgentPoses(scene.view, scene.calibration, lambda tick: scene[tick].map_from_ego)
