"""A graph records video in place of JPEG: the same images, and all else as without it."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from commands import Command, record

from simbev_ros.dataset import open_dataset
from simbev_ros.recording.digest import topic_digests
from simbev_ros.recording.reader import SceneBag
from simbev_ros.recording.verify import verify_bag

pytestmark = pytest.mark.graph

JPEG, VIDEO, KEY = "/ego/cam_front/rgb/image_raw/compressed", "/ego/cam_front/rgb/video", "cam_front/rgb"
OF_THE_RIG = {"/world/scene"}
"""Topics that contain the settings of the cameras."""


def test_video_is_recorded_in_place_of_jpeg_and_nothing_else_changes(
    small_config: Callable[..., Path], tmp_path: Path
) -> None:
    pytest.importorskip("foxglove_msgs")
    config = small_config(0.3, without=["lidar", "radar", "gnss", "imu"])
    images = record(Command, config, tmp_path / "images")
    config.write_text(config.read_text().replace("rate_hz: 10}\n", "rate_hz: 10, video: h264}\n", 1))
    video = record(Command, config, tmp_path / "video")
    assert verify_bag(video) == []
    with SceneBag(images) as one, SceneBag(video) as other:
        before, after = topic_digests(one), topic_digests(other)
    assert after.keys() - before.keys() == {VIDEO} and before.keys() - after.keys() == {JPEG}
    assert {name for name in before.keys() & after.keys() if before[name] != after[name]} == OF_THE_RIG
    of_images, of_video = (open_dataset(tmp_path / name).scenes[0] for name in ("images", "video"))
    compared = np.flatnonzero(of_images.has([KEY]))
    assert len(compared) == 3 and np.array_equal(compared, np.flatnonzero(of_video.has([KEY])))
    for tick in compared.tolist():
        assert np.abs(of_images[tick][KEY].astype(int) - of_video[tick][KEY]).mean() < 6
