"""Frames of a sheet: what is shown of a scene, and samples of slower sensors."""

from pathlib import Path

import numpy as np
import pytest
from sheet_scenes import BOXES, ODOMETRY, write_scene

from simbev_ros.foundation.errors import BagError
from simbev_ros.show.sheet.frames import FrameReader, middle_frame
from simbev_ros.show.sheet.views import find_views

FAST, SLOW = "cam_back/rgb", "cam_front/rgb"


def test_cameras_come_in_panorama_order_and_the_front_one_is_main(tmp_path: Path) -> None:
    names = ["roof", "cam_back", "cam_back_left", "cam_front", "cam_front_left"]
    keys = [f"{n}/{m}" for n in names for m in ("rgb", "depth") if (n, m) != ("roof", "depth")]
    views = find_views(write_scene(tmp_path / "a", {key: [0] for key in keys}))
    assert list(views.cameras) == ["cam_front_left", "cam_front", "cam_back_left", "cam_back", "roof"]
    assert views.main_camera == "cam_front"
    assert views.modalities == {"depth": "cam_front/depth"}


def test_a_slower_sensor_is_shown_with_its_last_sample(tmp_path: Path) -> None:
    scene = write_scene(tmp_path / "a", {FAST: [0, 1, 2, 3], SLOW: [0, 2]})
    reader = FrameReader(scene, find_views(scene))
    frames = list(reader.frames(0, 4))
    late = list(reader.frames(3, 1))
    assert [int(frame.arrays[FAST][0, 0, 0]) for frame in frames] == [0, 1, 2, 3]
    assert [int(frame.arrays[SLOW][0, 0, 0]) for frame in frames] == [0, 0, 2, 2]
    assert [(f.index, int(f.arrays[SLOW][0, 0, 0]), int(f.arrays[FAST][0, 0, 0])) for f in late] == [(3, 2, 3)]
    assert reader.rate_hz == 20


def test_a_silent_sensor_is_left_out(tmp_path: Path) -> None:
    scene = write_scene(tmp_path / "a", {FAST: list(range(30)), SLOW: [0]})
    frames = list(FrameReader(scene, find_views(scene)).frames(0, 30))
    assert SLOW in frames[20].arrays and SLOW not in frames[21].arrays


def test_a_bag_without_anything_to_show_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BagError, match="no images, semantic points"):
        find_views(write_scene(tmp_path / "a", {}))


@pytest.mark.parametrize(
    ("labeled", "middle"), [([], 4), ([*range(8)], 4), ([0, 5], 5), ([0, 3, 6], 3), ([0], 0), ([7], 7)]
)
def test_the_frame_in_the_middle_has_boxes_if_any_has(labeled: list[int], middle: int) -> None:
    assert middle_frame(np.isin(np.arange(8), labeled)) == middle


def test_the_middle_is_that_of_the_frames_that_are_shown(tmp_path: Path) -> None:
    scene = write_scene(tmp_path / "a", {FAST: [*range(2, 8)], BOXES: [0, 3], ODOMETRY: [*range(8)]})
    reader = FrameReader(scene, find_views(scene))
    assert reader.ticks[reader.middle] == 3
