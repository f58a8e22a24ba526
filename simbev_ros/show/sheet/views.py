"""Chooses what a preview shows of a scene as an agent sees it: cameras, modalities, lidar, radars and labels.

A scene enters; its ``Views``, from which frames are read and panels are drawn, leave. Keys are those of its frames.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from simbev_ros.config.camera import Camera
from simbev_ros.config.radar import Radar
from simbev_ros.dataset.scene import Scene
from simbev_ros.drawing.panels import MODALITY_PICTURES
from simbev_ros.foundation.errors import BagError
from simbev_ros.foundation.types import Float64Array
from simbev_ros.show.sheet import LabelPlacement

CAMERA_ORDER = ("front_left", "front", "front_right", "back_left", "back", "back_right")
"""Names of cameras without ``cam_`` in panorama order; all others come after them, by name."""

MODALITIES = tuple(MODALITY_PICTURES)
"""Modalities of the main camera that are shown, in order."""

BOXES, ODOMETRY, LABELS = TRUTH = ("boxes", "odom", "bev/labels")
"""Keys of the ground truth that is drawn over pictures."""


@dataclass(frozen=True, slots=True)
class LabeledCamera:
    """A camera over whose picture labels are drawn.

    Attributes:
        camera: The camera of the scene's rig.
        rgb: Key of the picture.
        depth: Key of the depth image, for occlusion; None if it was not recorded.
        semantic: Key of the semantic image, which distinguishes ground from objects on it; None if it was not
            recorded.
    """

    camera: Camera
    rgb: str
    depth: str | None
    semantic: str | None


@dataclass(frozen=True, slots=True)
class Views:
    """What a preview shows of a scene, by the keys of its frames.

    Attributes:
        cameras: Key of the RGB image by camera, in panorama order.
        main_camera: The camera that is shown in other modalities.
        modalities: Key by modality, of the main camera.
        points: Key of the semantic lidar, or None.
        ego_from_lidar: (4, 4) pose of that lidar.
        radars: (4, 4) ego_from_radar by the radar's key.
        bev: Key of the bird's-eye-view labels, or None.
        labels: Where the ground truth is drawn.
        labeled: Cameras over whose pictures ground truth is drawn, by name.
    """

    cameras: Mapping[str, str]
    main_camera: str
    modalities: Mapping[str, str]
    points: str | None
    ego_from_lidar: Float64Array
    radars: Mapping[str, Float64Array]
    bev: str | None
    labels: LabelPlacement
    labeled: Mapping[str, LabeledCamera]

    @property
    def label_panel(self) -> tuple[str, LabeledCamera] | None:
        """Name and keys of the camera that has a second picture with labels, or None."""
        return next(iter(self.labeled.items()), None) if self.labels == "panel" else None

    @property
    def keys(self) -> list[str]:
        """Keys that have a picture of their own."""
        single = [key for key in (self.points, self.bev) if key is not None]
        return [*self.cameras.values(), *self.modalities.values(), *self.radars, *single]

    @property
    def read_keys(self) -> set[str]:
        """Keys whose newest values a frame holds: those with a picture, and images with which labels are drawn."""
        occluders = [key for each in self.labeled.values() for key in (each.depth, each.semantic) if key]
        return {*self.keys, *occluders}


def find_views(scene: Scene, labels: LabelPlacement = "panel") -> Views:
    """Choose what is shown of a scene as its agent sees it.

    Args:
        scene: The scene, as one agent sees it.
        labels: Where labels are drawn.

    Raises:
        BagError: The bag cannot be read, or nothing in it can be shown.
        KeyError: The scene has no such agent.
    """
    rig, recorded = scene.view.rig, {key for key, source in scene.sources.items() if len(source.stamps_ns)}
    cameras = {camera.name: camera for camera in rig.of_type(Camera)}
    with_rgb = sorted((name for name in cameras if f"{name}/rgb" in recorded), key=_panorama_rank)
    main = min(
        (name for name in cameras if any(f"{name}/{modality}" in recorded for modality in MODALITIES)),
        key=main_camera_rank,
        default="",
    )
    lidars = {f"{sensor.name}/semantic_points": sensor.pose.ego_from_sensor for sensor in rig.sensors}
    points = next((key for key in sorted(lidars) if key in recorded), None)
    radars = {f"{radar.name}/points": radar.pose.ego_from_sensor for radar in rig.of_type(Radar)}
    labeled = with_rgb if labels == "cameras" else sorted(with_rgb, key=main_camera_rank)[:1]
    views = Views(
        {name: f"{name}/rgb" for name in with_rgb},
        main,
        {modality: f"{main}/{modality}" for modality in MODALITIES if f"{main}/{modality}" in recorded},
        points,
        lidars[points] if points else np.eye(4),
        {key: pose for key, pose in radars.items() if key in recorded},
        LABELS if LABELS in recorded else None,
        labels,
        {
            name: LabeledCamera(
                cameras[name],
                f"{name}/rgb",
                *(f"{name}/{each}" if f"{name}/{each}" in recorded else None for each in ("depth", "semantic")),
            )
            for name in (labeled if labels != "off" and ODOMETRY in recorded else [])
        },
    )
    if not views.keys:
        raise BagError(f"{scene.path}: no images, semantic points or bird's-eye-view labels to show")
    return views


def _panorama_rank(camera: str) -> tuple[int, str]:
    name = camera.removeprefix("cam_")
    return (CAMERA_ORDER.index(name) if name in CAMERA_ORDER else len(CAMERA_ORDER), name)


def main_camera_rank(camera: str) -> tuple[bool, int, str]:
    """Sort key of camera names: the front camera first, then the panorama order."""
    return (camera.removeprefix("cam_") != "front", *_panorama_rank(camera))
