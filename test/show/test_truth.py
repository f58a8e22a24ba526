"""Tests of the ground truth at the time of a picture, from messages of other times."""

from pathlib import Path

import numpy as np
import pytest
from sheet_scenes import BEV, BOXES, ODOMETRY, rpy_of, write_scene

from simbev_ros.foundation.geometry.transforms import rotations_from_rpy
from simbev_ros.foundation.semantics import BEV_CLASSES
from simbev_ros.show.sheet.frames import FrameReader, SheetFrame
from simbev_ros.show.sheet.views import find_views

RGB = "cam_front/rgb"


def frames(path: Path, ticks_of: dict[str, list[int]]) -> list[SheetFrame]:
    """Sheet frames of a scene with values that contain their ticks."""
    scene = write_scene(path, ticks_of)
    reader = FrameReader(scene, find_views(scene))
    return list(reader.frames(0, len(reader.ticks)))


def test_a_slow_cameras_picture_has_the_truth_of_its_own_time(tmp_path: Path) -> None:
    everything = frames(
        tmp_path / "a", {RGB: [0, 3], BEV: [0, 1, 2, 3, 4], BOXES: [0, 1, 2, 3, 4], ODOMETRY: [0, 1, 2, 3, 4]}
    )
    camera = [frame.truths[RGB] for frame in everything]
    grid = [frame.truths[BEV] for frame in everything]
    assert [truth.map_from_ego[0, 3] for truth in camera] == [0, 0, 0, 3, 3]
    assert [float(truth.boxes["x"][0]) for truth in camera if truth.boxes is not None] == [0, 0, 0, 3, 3]
    assert [float(truth.boxes["x"][0]) for truth in grid if truth.boxes is not None] == [0, 1, 2, 3, 4]
    assert camera[3].map_from_ego[:3, :3] == pytest.approx(rotations_from_rpy(rpy_of(3)))


def test_older_labels_are_level_at_the_egos_pose_at_their_stamp(tmp_path: Path) -> None:
    truth = frames(tmp_path / "a", {RGB: [4], BEV: [2], BOXES: [1], ODOMETRY: [0, 1, 2, 3, 4]})[-1].truths[RGB]
    assert truth.labels is not None and truth.labels[0, 0] == 2
    assert truth.map_from_grid[:3, 3].tolist() == [2, 2, 3]
    assert truth.map_from_grid[:3, :3] == pytest.approx(rotations_from_rpy(np.array([0, 0, 0.2])))
    assert truth.map_from_ego[0, 3] == 4
    assert truth.boxes is None, "their objects have moved since"


def test_older_labels_lack_what_may_have_moved(tmp_path: Path) -> None:
    car = 1 << BEV_CLASSES.index("car")
    everything = frames(tmp_path / "a", {RGB: [car + 2, car + 3], BEV: [car + 2], ODOMETRY: [*range(car + 4)]})
    seen = {frame.ticks[RGB]: frame.truths[RGB].labels for frame in everything if RGB in frame.truths}
    assert {tick: int(labels[0, 0]) for tick, labels in seen.items() if labels is not None} == {
        car + 2: car + 2,
        car + 3: 2,
    }


def test_ground_truth_of_a_silent_topic_expires(tmp_path: Path) -> None:
    images = list(range(0, 50, 2))
    everything = frames(tmp_path / "a", {RGB: images, BOXES: [0], ODOMETRY: list(range(40)), BEV: [1]})
    held = {frame.ticks[RGB]: frame.truths.get(RGB) for frame in everything}
    assert held[0] is not None and held[0].labels is None
    assert held[0].boxes is not None
    assert held[20] is not None and held[20].boxes is None and held[20].labels is not None
    assert held[22] is not None and held[22].labels is None
    assert held[38] is not None and held[40] is None, "a pose of another time would be wrong"


def test_without_the_egos_pose_there_is_no_ground_truth(tmp_path: Path) -> None:
    (frame,) = frames(tmp_path / "a", {RGB: [0], BOXES: [0]})
    assert not frame.truths
