"""The cameras that a camera node serves, with their topics, in groups that are rendered together.

A scene's specification enters ``camera_groups``; the groups hold what the node needs to know of each camera and agent.
"""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Self

from simbev_ros.config.camera import Camera
from simbev_ros.config.modalities import Modality
from simbev_ros.ros.msgs.sensor_topics import (
    CameraTopics,
    camera_info_topic,
    camera_topics,
    label_info_topic,
)
from simbev_ros.ros.msgs.topic import Topic
from simbev_ros.schema.scene.agents import AgentView
from simbev_ros.schema.scene.state import WorldState


@dataclass(frozen=True, slots=True, eq=False)
class MountedCamera:
    """A camera of an agent. Agents with equal rigs have equal cameras, so this one is equal to itself only.

    Attributes:
        camera: The camera.
        frame: Frame of its images.
        topics: Topics of its images, by modality.
        info: The topic with the CameraInfo that all its images share.
        label_info: The topic with the names of the classes in its semantic images; None: it has none.
    """

    camera: Camera
    frame: str
    topics: Mapping[Modality, CameraTopics]
    info: Topic
    label_info: Topic | None

    @classmethod
    def on(cls, view: AgentView, camera: Camera) -> Self:
        """A camera of the agent that has this view of a scene."""
        return cls(
            camera,
            frame=f"{view.agent}/{camera.name}_optical",
            topics=camera_topics(view, camera),
            info=camera_info_topic(view, camera),
            label_info=label_info_topic(view, camera),
        )

    @property
    def jpeg_quality(self) -> int | None:
        """Quality of the product's color images; None: that of the recording."""
        return self.camera.imager.jpeg_quality if self.camera.imager else None


@dataclass(slots=True)
class CameraGroup:
    """Cameras of one agent that take their images at the same ticks.

    Attributes:
        view: The agent's view of the scene.
        period_ticks: Number of ticks between two images.
        cameras: The cameras.
        noise_seed: Seed of the images' noise.
        previous: The state of the previous images, as the agent sees it, to which flow refers; None: there are none.
    """

    view: AgentView
    period_ticks: int
    cameras: Sequence[MountedCamera]
    noise_seed: int
    previous: WorldState | None = None

    @property
    def lens_seed(self) -> int:
        """Seed of the drops on lenses; those of the ego's depend on the camera alone."""
        return 0 if self.view.is_ego else self.noise_seed


def camera_groups(views: Iterable[AgentView], names: Collection[str]) -> Iterator[CameraGroup]:
    """Groups of cameras, agent by agent, each agent's shortest period first.

    Args:
        views: The agents' views of the scene.
        names: Cameras as ``agent/camera``, or ``camera`` of every agent; empty: all cameras.
    """
    for view in views:
        agent, noise_seed = view.agent, view.noise_seed
        by_period: dict[int, list[MountedCamera]] = {}
        for camera in view.rig.of_type(Camera):
            if not names or camera.name in names or f"{agent}/{camera.name}" in names:
                mounted = MountedCamera.on(view, camera)
                by_period.setdefault(view.scene.period_ticks(camera.rate_hz), []).append(mounted)
        for period_ticks in sorted(by_period):
            yield CameraGroup(view, period_ticks, by_period[period_ticks], noise_seed)
