"""Makes what a model sees of a recorded frame: the one place where its points and images are built."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from simbev_ros.baselines.frames import points_of_frame, sweeps_of_frame
from simbev_ros.baselines.inference import Answer, Baseline
from simbev_ros.baselines.node.image_fit import ImageFit
from simbev_ros.baselines.recordings.clouds import read_cloud
from simbev_ros.baselines.recordings.ground import ego_from_lidar_in_frame, ego_from_lidar_of
from simbev_ros.baselines.recordings.recording import RecordedFrame, RecordedImage, RecordedSweep
from simbev_ros.evaluation.realism.samples import READERS
from simbev_ros.foundation.errors import InputError, foreign_content
from simbev_ros.foundation.geometry.camera import PinholeCamera
from simbev_ros.foundation.geometry.transforms import apply, inverse
from simbev_ros.foundation.types import Float32Array, Float64Array, UInt8Array

BODY_M = 2.5
"""Horizontal distance from the lidar up to which points are those of the vehicle itself, and are left out."""
_GROUND_FRAMES = 12


class Photo(NamedTuple):
    """An image with what is known of it, as of ``RecordedImage``; the transform is from the ego."""

    rgb: UInt8Array
    camera: PinholeCamera
    optical_from_ego: Float64Array
    reference_m: Float64Array


class FrameView(NamedTuple):
    """What a frame shows.

    Attributes:
        points: (N, 4) as from ``frames.points_of_frame``; the level frame is the ego's.
        photos: Its images by camera.
        ego_from_lidar: (4, 4).
    """

    points: Float32Array
    photos: Mapping[str, Photo]
    ego_from_lidar: Float64Array


def ground_pose(frames: Sequence[RecordedFrame]) -> Float64Array | None:
    """(4, 4) ego_from_lidar of the frames that do not know it, found in some of them; None: all know it.

    Raises:
        InputError: A cloud cannot be read, or none shows ground.
    """
    unknown = [frame for frame in frames if frame.ego_from_lidar is None]
    if not unknown:
        return None
    chosen = np.unique(np.linspace(0, len(unknown) - 1, _GROUND_FRAMES).astype(int)).tolist()
    return ego_from_lidar_of([read_cloud(unknown[i].sweep.path, unknown[i].sweep.columns) for i in chosen])


def view_frame(frame: RecordedFrame, ages_ns: Sequence[int], ground: Float64Array | None) -> FrameView:
    """Read a frame.

    Args:
        frame: The frame.
        ages_ns: Ages of the sweeps that the model takes.
        ground: From ``ground_pose``.

    Raises:
        InputError: A file cannot be read.
    """
    ego_from_lidar = ground if frame.ego_from_lidar is None else frame.ego_from_lidar
    if ego_from_lidar is None:
        raise ValueError("a frame that does not know where the ground is needs ground_pose")
    if frame.ego_from_lidar is None and frame.sweep.map_from_lidar is None:  # of another time than the others
        ego_from_lidar = ego_from_lidar_in_frame(ego_from_lidar, read_cloud(frame.sweep.path, frame.sweep.columns))
    points = _points(_sweeps(frame, ages_ns), ego_from_lidar)
    photos = {image.camera: _photo(image, ego_from_lidar) for image in frame.images()}
    return FrameView(points, photos, ego_from_lidar)


def answer_view(baseline: Baseline, view: FrameView) -> Answer:
    """A model's answer to a frame, in the ego's frame; cameras that are missing are black and see nothing.

    Raises:
        InputError: The model does not compute what a baseline does.
    """
    if not baseline.modality.has_cameras:
        return baseline.answer(view.points)
    width_px, height_px = baseline.camera_size_px or (0, 0)
    images = np.zeros((baseline.cameras, height_px, width_px, 3), np.uint8)
    pixel_from_level = np.zeros((baseline.cameras, 3, 4), np.float32)
    for index, photo in enumerate([*view.photos.values()][: baseline.cameras]):
        fit = ImageFit.of_camera(photo.camera, (width_px, height_px))
        images[index] = fit.fit(photo.rgb)
        pixel_from_level[index] = fit.fitted_from_source @ photo.camera.matrix @ photo.optical_from_ego[:3]
    return baseline.answer(view.points, images, pixel_from_level)


def _sweeps(frame: RecordedFrame, ages_ns: Sequence[int]) -> list[RecordedSweep | None]:
    """The sweeps of some ages, newest first; only its own where poses are unknown."""
    stamps_ns = np.array([sweep.stamp_ns for sweep in frame.sweeps], np.int64)
    indices = [] if frame.sweep.map_from_lidar is None else sweeps_of_frame(frame.sweep.stamp_ns, stamps_ns, ages_ns)
    return [frame.sweep, *(frame.sweeps[index] if index >= 0 else None for index in indices[1:])]


def _points(sweeps: Sequence[RecordedSweep | None], ego_from_lidar: Float64Array) -> Float32Array:
    """(N, 4) points of a frame with the index of their sweep; the map is the ego's frame of the newest one."""
    clouds: list[Float32Array | None] = [None] * len(sweeps)
    poses: list[Float64Array | None] = [None] * len(sweeps)
    lidar_from_map = None
    for index, sweep in enumerate(sweeps):
        if sweep is not None:
            pose = np.eye(4) if sweep.map_from_lidar is None else sweep.map_from_lidar
            lidar_from_map = inverse(pose) if lidar_from_map is None else lidar_from_map
            cloud = read_cloud(sweep.path, sweep.columns)[:, :3].astype(np.float64)
            cloud = cloud[np.hypot(cloud[:, 0], cloud[:, 1]) > BODY_M]
            clouds[index] = apply(ego_from_lidar, cloud).astype(np.float32)
            poses[index] = ego_from_lidar @ lidar_from_map @ pose @ inverse(ego_from_lidar)
    return points_of_frame(clouds, poses)


def _photo(image: RecordedImage, ego_from_lidar: Float64Array) -> Photo:
    suffix = image.path.suffix.lower().replace(".jpeg", ".jpg")
    if suffix not in (".jpg", ".png"):
        raise InputError(f"{image.path}: is not an image; files that are read end in .jpg, .jpeg, .png")
    with foreign_content(image.path):
        rgb: UInt8Array = READERS[suffix](image.path).rgb  # type: ignore[union-attr]
    (fx, _, cx), (_, fy, cy), _ = image.matrix.tolist()
    camera = PinholeCamera(rgb.shape[1], rgb.shape[0], fx, fy, cx, cy)
    return Photo(rgb, camera, image.optical_from_lidar @ inverse(ego_from_lidar), image.reference_m)
