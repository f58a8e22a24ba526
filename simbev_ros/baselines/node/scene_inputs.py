"""Inputs of a baseline in a scene: topics, rates, poses and projections, from its specification. Imports no ROS."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from simbev_ros.baselines.modality import Modality
from simbev_ros.baselines.node.image_fit import ImageFit
from simbev_ros.config.camera import Camera
from simbev_ros.config.lidar import Lidar
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.geometry.camera import LensCamera
from simbev_ros.foundation.geometry.fisheye import FisheyeCamera
from simbev_ros.foundation.geometry.grid import BevGrid
from simbev_ros.foundation.geometry.transforms import SENSOR_FROM_OPTICAL, inverse
from simbev_ros.foundation.types import Float64Array
from simbev_ros.ros.msgs.sensor_topics import camera_topics, points_name
from simbev_ros.ros.msgs.topics import odometry_name
from simbev_ros.scene.frames import ego_frame, ego_from_base_link
from simbev_ros.schema.scene.agents import AgentView, agent_view
from simbev_ros.schema.scene.spec import SceneSpec


@dataclass(frozen=True, eq=False)
class LidarInput:
    """The lidar that a baseline sees.

    Attributes:
        topic: Topic of its points.
        period_ticks: Number of ticks between clouds.
        ego_from_lidar: (4, 4) pose.
    """

    topic: str
    period_ticks: int
    ego_from_lidar: Float64Array


@dataclass(frozen=True, eq=False)
class CameraInput:
    """A camera that a baseline sees.

    Attributes:
        compressed_topic: Topic of its images as JPEG.
        raw_topic: Topic of its images.
        period_ticks: Number of ticks between images.
        fit: How they become the model's.
        pixel_from_ego: (3, 4) projection from the ego frame to u * depth, v * depth, depth in the model's image.
    """

    compressed_topic: str
    raw_topic: str
    period_ticks: int
    fit: ImageFit
    pixel_from_ego: Float64Array


@dataclass(frozen=True, eq=False)
class SceneInputs:
    """Inputs of a baseline in a scene.

    Attributes:
        name: Name of the scene, for reports on /sync/ready.
        start_ns: Stamp of tick 0; earlier ticks are a lead-in without data of sensors.
        tick_ns: Time between ticks.
        odometry_topic: Topic of the ego's motion.
        base_link_from_ego: (4, 4) pose of the ego frame, to which poses of sensors and grids refer.
        ego_frame: Name of the ego frame.
        grid: Shape of the grid of /ego/bev/labels; None: the scene has none.
        lidar: The lidar; None: the model sees none.
        cameras: The cameras, by name; empty: the model sees none.
        unseen_cameras: Names of cameras that are more than the model takes.
    """

    name: str
    start_ns: int
    tick_ns: int
    odometry_topic: str
    base_link_from_ego: Float64Array
    ego_frame: str
    grid: BevGrid | None
    lidar: LidarInput | None
    cameras: dict[str, CameraInput]
    unseen_cameras: tuple[str, ...]

    def due(self, stamp_ns: int) -> list[str]:
        """Topics (of a camera, the compressed one) that have a message at a stamp."""
        sources = [(each.topic, each.period_ticks) for each in (self.lidar,) if each is not None]
        sources += [(each.compressed_topic, each.period_ticks) for each in self.cameras.values()]
        tick = (stamp_ns - self.start_ns) // self.tick_ns
        return [topic for topic, period_ticks in sources if tick >= 0 and tick % period_ticks == 0]

    def is_frame(self, stamp_ns: int) -> bool:
        """Whether all that the model sees is due at a stamp."""
        return len(self.due(stamp_ns)) == len(self.cameras) + (self.lidar is not None)


def inputs_of_scene(
    text: str,
    modality: Modality,
    lidar_topic: str = "",
    cameras: int = 0,
    size_px: tuple[int, int] = (0, 0),
    agent: str = "",
) -> SceneInputs:
    """The inputs of a scene for a baseline.

    Args:
        text: Specification of the scene, JSON.
        modality: What the baseline sees.
        lidar_topic: Topic of the points that it sees; empty: the first lidar's.
        cameras: Number of its images.
        size_px: Width and height of its images.
        agent: Name of the agent with the sensors that it sees; empty: the first one.

    Raises:
        InputError: There is no such agent, its rig lacks what the model sees, or a camera has a distorting lens.
    """
    spec = SceneSpec.from_json(text)
    try:
        view = agent_view(spec, agent or None)
    except KeyError as error:
        raise InputError(f"agent: {error.args[0]}") from None
    bev = view.annotation.bev
    colored = [camera for camera in view.rig.of_type(Camera) if "rgb" in camera.modalities]
    if modality.has_cameras and not colored:
        raise InputError(f"{spec.name}: the rig has no camera with rgb images")
    seen = colored[:cameras] if modality.has_cameras else []
    return SceneInputs(
        name=spec.name,
        start_ns=spec.start_ns,
        tick_ns=spec.tick_ns,
        odometry_topic=odometry_name(view.agent),
        base_link_from_ego=inverse(ego_from_base_link(view)),
        ego_frame=ego_frame(view),
        grid=None if bev is None else BevGrid(bev.rows, bev.columns, bev.cell_m),
        lidar=_lidar_input(view, lidar_topic) if modality.has_lidar else None,
        cameras={camera.name: _camera_input(view, camera, size_px) for camera in seen},
        unseen_cameras=tuple(camera.name for camera in colored[cameras:]) if modality.has_cameras else (),
    )


def stacked_projections(cameras: Sequence[CameraInput]) -> Float64Array:
    """(K, 3, 4) projections of K cameras from the ego frame."""
    return np.array([camera.pixel_from_ego for camera in cameras], np.float64).reshape(-1, 3, 4)


def _lidar_input(view: AgentView, topic: str) -> LidarInput:
    lidars = {points_name(view.agent, lidar.name): lidar for lidar in view.rig.of_type(Lidar) if lidar.points}
    if not lidars:
        raise InputError(f"{view.scene.name}: the rig has no lidar with points")
    topic = topic or next(iter(lidars))
    if topic not in lidars:
        raise InputError(f"lidar_topic: no lidar of {view.scene.name} publishes {topic}; allowed: {', '.join(lidars)}")
    lidar = lidars[topic]
    return LidarInput(topic, view.scene.period_ticks(lidar.rate_hz), lidar.pose.ego_from_sensor)


def _camera_input(view: AgentView, camera: Camera, size_px: tuple[int, int]) -> CameraInput:
    model = camera.model
    if isinstance(model, LensCamera | FisheyeCamera):
        raise InputError(
            f"{view.scene.name}: camera {camera.name}: has a distorting lens; the baselines need an ideal one"
        )
    topics, fit = camera_topics(view, camera)["rgb"], ImageFit.of_camera(model, size_px)
    optical_from_ego = inverse(camera.pose.ego_from_sensor @ SENSOR_FROM_OPTICAL)
    return CameraInput(
        compressed_topic=topics.compressed.name,
        raw_topic=topics.raw.name,
        period_ticks=view.scene.period_ticks(camera.rate_hz),
        fit=fit,
        pixel_from_ego=fit.fitted_from_source @ model.matrix @ optical_from_ego[:3],
    )
