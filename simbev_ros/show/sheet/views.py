"""Chooses the topics of a bag that a preview shows of an agent: cameras, modalities, lidar, radars and labels.

A bag enters; its ``Views``, from which frames are read and panels are drawn, leave.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from simbev_ros.config.camera import Camera
from simbev_ros.config.radar import Radar
from simbev_ros.config.rig import Rig
from simbev_ros.drawing.panels import MODALITY_PICTURES
from simbev_ros.foundation.errors import BagError
from simbev_ros.foundation.types import Float64Array
from simbev_ros.recording.indexed_bag import IndexedBag
from simbev_ros.schema.scene.agents import AgentView, agent_view
from simbev_ros.show.sheet import LabelPlacement
from simbev_ros.show.sheet.truth import TruthTopics

CAMERA_ORDER = ("front_left", "front", "front_right", "back_left", "back", "back_right")
"""Names of cameras without ``cam_`` in panorama order; all others come after them, by name."""

MODALITIES = tuple(MODALITY_PICTURES)
"""Modalities of the main camera that are shown, in order."""

_ANY_AGENT = "(?!world/)[^/]+"
"""Pattern of the agent's name for a bag without a scene."""
_IMAGE = "(?P<camera>[^/]+)/(?P<modality>[^/]+)/image_raw(/compressed(Depth)?)?"
_POINTS, _BEV, _BOXES, _ODOMETRY = "[^/]+/semantic_points", "bev/labels", "boxes", "odom"
"""Patterns of the names of an agent's topics without the agent."""


@dataclass(frozen=True, slots=True)
class LabeledCamera:
    """A camera with labels drawn over its picture.

    Attributes:
        camera: The camera of the scene's rig.
        rgb: Topic of the picture.
        depth: Topic of the depth image, for occlusion; None if it was not recorded.
        semantic: Topic of the semantic image, which distinguishes ground from objects on it; None if it was not
            recorded.
    """

    camera: Camera
    rgb: str
    depth: str | None
    semantic: str | None


@dataclass(frozen=True, slots=True)
class Views:
    """The topics of a bag that a preview shows.

    Attributes:
        view: The scene as the agent sees it; None: the bag holds none.
        cameras: RGB topic by camera, in panorama order.
        main_camera: The camera that is shown in other modalities.
        modalities: Topic by modality, of the main camera.
        points: Topic of the semantic lidar, or None.
        ego_from_lidar: (4, 4) pose of that lidar.
        radars: (4, 4) ego_from_radar by the radar's topic.
        bev: Topic of the bird's-eye-view labels, or None.
        truth: Topics of the ground truth that is drawn over the other pictures.
        labels: Where the ground truth is drawn.
        labeled: Cameras with ground truth drawn over their pictures, by name.
    """

    view: AgentView | None
    cameras: Mapping[str, str]
    main_camera: str
    modalities: Mapping[str, str]
    points: str | None
    ego_from_lidar: Float64Array
    radars: Mapping[str, Float64Array]
    bev: str | None
    truth: TruthTopics
    labels: LabelPlacement
    labeled: Mapping[str, LabeledCamera]

    @property
    def label_panel(self) -> tuple[str, LabeledCamera] | None:
        """Name and topics of the camera that has a second picture with labels, or None."""
        return next(iter(self.labeled.items()), None) if self.labels == "panel" else None

    @property
    def topics(self) -> list[str]:
        """The topics that have a picture of their own."""
        single = [topic for topic in (self.points, self.bev) if topic is not None]
        return [*self.cameras.values(), *self.modalities.values(), *self.radars, *single]

    @property
    def read_topics(self) -> set[str]:
        """All topics that are needed to draw the sheet, including ground truth."""
        beside = [topic for each in self.labeled.values() for topic in (each.depth, each.semantic) if topic]
        return {*self.topics, *self.truth.names, *beside}


def find_views(bag: IndexedBag, labels: LabelPlacement = "panel", agent: str | None = None) -> Views:
    """Choose the topics of an agent by patterns of their names; raw images are preferred to compressed ones.

    Args:
        bag: The bag of a scene.
        labels: Where labels are drawn.
        agent: Name of the agent; None: the ego. If the bag holds no scene, topics of any agent are chosen.

    Raises:
        BagError: The bag has no topic that can be shown.
        KeyError: The scene has no such agent.
    """
    spec = bag.spec
    view = agent_view(spec, agent) if spec else None
    rig = view.rig if view else None
    prefix = f"/{re.escape(rig.agent) if rig else _ANY_AGENT}/"
    names = sorted(name for name, topic in bag.topics.items() if len(topic.stamps_ns) and re.match(prefix, name))
    images: dict[tuple[str, str], str] = {}
    for name in sorted(names, key=len):
        if match := re.fullmatch(prefix + _IMAGE, name):
            images.setdefault((match["camera"], match["modality"]), name)
    cameras = sorted({camera for camera, modality in images if modality == "rgb"}, key=_panorama_rank)
    others = sorted({camera for camera, modality in images if modality in MODALITIES}, key=main_camera_rank)
    main = others[0] if others else ""
    points, boxes, odometry, bev = (_first(prefix + each, names) for each in (_POINTS, _BOXES, _ODOMETRY, _BEV))
    truth = TruthTopics(boxes, odometry, bev)
    labeled = cameras if labels == "cameras" else sorted(cameras, key=main_camera_rank)[:1]
    views = Views(
        view,
        {camera: images[camera, "rgb"] for camera in cameras},
        main,
        {modality: images[main, modality] for modality in MODALITIES if (main, modality) in images},
        points,
        _lidar_pose(rig, points),
        {topic: pose for topic, pose in _radar_poses(rig).items() if topic in names},
        truth.labels,
        truth if labels != "off" else TruthTopics(),
        labels,
        _labeled(rig, labeled, images) if labels != "off" and truth.odometry else {},
    )
    if not views.topics:
        raise BagError(f"{bag.file}: no images, semantic points or bird's-eye-view labels to show")
    return views


def _first(pattern: str, names: list[str]) -> str | None:
    return next((name for name in names if re.fullmatch(pattern, name)), None)


def _radar_poses(rig: Rig | None) -> dict[str, Float64Array]:
    """(4, 4) ego_from_radar of each radar of the scene's rig, by topic."""
    radars = rig.of_type(Radar) if rig else ()
    return {f"/{rig.agent}/{radar.name}/points": radar.pose.ego_from_sensor for radar in radars} if rig else {}


def _lidar_pose(rig: Rig | None, points: str | None) -> Float64Array:
    """(4, 4) ego_from_lidar of a topic; the identity if the rig does not have that lidar."""
    poses = {f"/{rig.agent}/{s.name}/semantic_points": s.pose.ego_from_sensor for s in rig.sensors} if rig else {}
    return poses.get(points or "", np.eye(4))


def _labeled(rig: Rig | None, names: list[str], images: Mapping[tuple[str, str], str]) -> dict[str, LabeledCamera]:
    """The named cameras that the rig has, with the topics of their images, by name."""
    cameras = {camera.name: camera for camera in rig.of_type(Camera)} if rig else {}
    return {
        name: LabeledCamera(
            cameras[name], images[name, "rgb"], images.get((name, "depth")), images.get((name, "semantic"))
        )
        for name in names
        if name in cameras
    }


def _panorama_rank(camera: str) -> tuple[int, str]:
    name = camera.removeprefix("cam_")
    return (CAMERA_ORDER.index(name) if name in CAMERA_ORDER else len(CAMERA_ORDER), name)


def main_camera_rank(camera: str) -> tuple[bool, int, str]:
    """Sort key of camera names: the front camera first, then the panorama order."""
    return (camera.removeprefix("cam_") != "front", *_panorama_rank(camera))
