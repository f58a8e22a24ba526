"""Predictions in coordinate frames other than the map's: by hand, and those of a recorded scene."""

from pathlib import Path

import numpy as np
import pytest
from made_up_boxes import some_boxes
from prediction_scene import record

from simbev_ros.dataset import open_dataset
from simbev_ros.evaluation.metrics.boxes import Predictions
from simbev_ros.evaluation.predictions.predicted_boxes import PredictedBoxes, Reference, boxes_in_map, join_boxes
from simbev_ros.evaluation.predictions.reference_frames import ReferenceFrames
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.geometry.transforms import SENSOR_FROM_OPTICAL, matrices_from_xyz_rpy
from simbev_ros.foundation.types import Float64Array


def predicted_in(frame_id: str, **columns: object) -> PredictedBoxes:
    boxes = some_boxes([[3, 1, -2]], yaw_rad=0.25, velocity_mps=(1, 2, 0), **columns)
    return PredictedBoxes.with_reference(Predictions(boxes, np.array([0.5])), Reference(frame_id, "answers.npz"))


def pose(tick: int, frame_id: str) -> Float64Array:
    """Pose of an ego at x 10, y 20 that looks left, with a lidar 1 m ahead and 2 m above, turned left again."""
    assert frame_id == "ego/lidar"
    map_from_ego = matrices_from_xyz_rpy(np.array([10.0 + tick, 20, 0]), np.array([0, 0, np.pi / 2]))
    return map_from_ego @ matrices_from_xyz_rpy(np.array([1.0, 0, 2]), np.array([0, 0, np.pi / 2]))


def test_boxes_in_a_rotated_lidar_frame_by_hand() -> None:
    found = boxes_in_map(
        join_boxes([predicted_in("ego/lidar"), predicted_in("map"), predicted_in("ego/lidar", frame=5)]), pose
    )
    boxes = found.boxes
    np.testing.assert_allclose(boxes.center_m, [[7, 20, 0], [3, 1, -2], [12, 20, 0]], atol=1e-12)
    np.testing.assert_allclose(boxes.yaw_rad, [0.25 - np.pi, 0.25, 0.25 - np.pi])
    np.testing.assert_allclose(boxes.velocity_mps, [[-1, -2, 0], [1, 2, 0], [-1, -2, 0]], atol=1e-12)
    np.testing.assert_array_equal(boxes.frame, [0, 0, 5])
    np.testing.assert_array_equal(boxes.size_m, [[4, 2, 2]] * 3)
    np.testing.assert_array_equal(found.score, [0.5] * 3)


def test_unknown_velocities_stay_unknown_and_boxes_in_a_tilted_frame_stay_upright() -> None:
    boxes = some_boxes([[10, 0, 0]], velocity_mps=[[np.nan] * 3])
    predicted = PredictedBoxes.with_reference(Predictions(boxes, np.ones(1)), Reference("ego/base_link", "a"))
    uphill = matrices_from_xyz_rpy(np.zeros(3), np.array([0.0, -0.1, 0.5]))
    found = boxes_in_map(predicted, lambda tick, frame_id: uphill).boxes
    assert np.isnan(found.velocity_mps).all()
    np.testing.assert_allclose(found.yaw_rad, [0.5])
    np.testing.assert_allclose(
        found.center_m, [[10 * np.cos(0.1) * np.cos(0.5), 10 * np.cos(0.1) * np.sin(0.5), 10 * np.sin(0.1)]]
    )


def test_optical_frames_are_refused() -> None:
    with pytest.raises(InputError, match=r"^answers.npz: frame_id: the z axis of 'cam_optical' does not point up"):
        boxes_in_map(predicted_in("cam_optical"), lambda tick, frame_id: SENSOR_FROM_OPTICAL)


def test_frames_of_a_recorded_scene(tmp_path: Path) -> None:
    scene = open_dataset(record(tmp_path / "Blocks-0000")).scenes[0]
    frames = ReferenceFrames.from_scene(scene)
    assert frames.names[:3] == ("map", "ego/base_link", "ego/cam_front") and "ego/lidar" in frames.names
    map_from_ego = matrices_from_xyz_rpy(np.array([3.0, 2, 0.5]), np.array([0, 0, 0.3]))
    np.testing.assert_allclose(frames(3, "ego/base_link"), map_from_ego, atol=1e-12)
    lifted = map_from_ego @ matrices_from_xyz_rpy(np.array([0, 0, 1.8]), np.zeros(3))
    np.testing.assert_allclose(frames(3, "ego/lidar"), lifted, atol=1e-12)
    optical = frames(3, "ego/cam_front_optical")[:3, :3]
    np.testing.assert_allclose(optical[:, 2], [np.cos(0.3 + np.pi / 2), np.sin(0.3 + np.pi / 2), 0], atol=1e-12)
    np.testing.assert_allclose(optical[:, 1], [0, 0, -1], atol=1e-12)
    text = (
        r"^answers.npz: frame_id: there is no 'lidar' in scene Blocks-0000; allowed: map, ego/base_link, ego/cam_front"
    )
    with pytest.raises(InputError, match=text):
        boxes_in_map(predicted_in("lidar"), frames)
