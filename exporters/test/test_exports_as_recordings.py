"""An export in nuScenes' layout, read as a recording of others, has the points and boxes of the dataset."""

from pathlib import Path

import numpy as np
import pytest

from simbev_ros.baselines.recordings.model_inputs import BODY_M, view_frame
from simbev_ros.baselines.recordings.nuscenes import nuscenes_frames
from simbev_ros.baselines.recordings.recording import OTHER_CLASS, boxes_in_frame
from simbev_ros.dataset import Frame, columns, open_dataset
from simbev_ros.foundation.geometry.transforms import apply, inverse, rotations_from_rpy


def frames_of_dataset(folder: Path) -> dict[int, Frame]:
    """Frames of all scenes by their stamps in microseconds."""
    scenes = open_dataset(folder / "set").scenes
    return {int(stamp_ns) // 1000: scene[tick] for scene in scenes for tick, stamp_ns in enumerate(scene.stamps_ns)}


def test_boxes_and_points_are_those_of_the_dataset_in_the_frame_of_the_ego(nuscenes_folder: Path) -> None:
    ours = frames_of_dataset(nuscenes_folder)
    read = nuscenes_frames(nuscenes_folder / "out", "v1.0-trainval")
    compared = 0
    for recorded in read:
        frame, view = ours[recorded.sweep.stamp_ns // 1000], view_frame(recorded, (0,), None)
        assert recorded.labels is not None
        labels = boxes_in_frame(recorded.labels().boxes, view.ego_from_lidar)
        labels = labels[labels["class"] != OTHER_CLASS]
        table = frame["boxes"]
        center_m = apply(inverse(frame.map_from_ego), columns(table, "x", "y", "z").astype(np.float64))
        found_m = columns(labels, "x", "y", "z")
        distance_m = np.linalg.norm(found_m[:, None] - center_m, axis=2)
        nearest = distance_m.argmin(axis=1)
        assert distance_m.min(axis=1).max() < 0.02 and len(np.unique(nearest)) == len(nearest)
        rotations = rotations_from_rpy(columns(table[nearest], "roll", "pitch", "yaw").astype(np.float64))
        ahead = rotations[:, :, 0] @ frame.map_from_ego[:3, :3]
        heading_rad, is_level = np.arctan2(ahead[:, 1], ahead[:, 0]), np.abs(ahead[:, 2]) < 0.5
        turn_rad = np.angle(np.exp(1j * (labels["yaw"] - heading_rad)))[is_level]
        assert is_level.any() and np.abs(turn_rad).max() < 0.1  # the lidar leans, and boxes are upright there
        compared += len(labels)
        calibration = frame.scene.calibration["lidar"]
        points_lidar = columns(frame["lidar/points"], "x", "y", "z").astype(np.float64)
        points_lidar = points_lidar[np.hypot(points_lidar[:, 0], points_lidar[:, 1]) > BODY_M]
        points_ego = apply(calibration.ego_from_sensor, points_lidar)
        assert np.sort(view.points[:, 2]) == pytest.approx(np.sort(points_ego[:, 2]), abs=0.01)
        for photo in view.photos.values():
            assert photo.optical_from_ego[3].tolist() == [0, 0, 0, 1]
    assert compared > 20 and len(read) >= 3
