"""A graph records video in place of JPEG: the same images, and all else as without it."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from changed_recording import record_changed

pytestmark = pytest.mark.graph

JPEG, VIDEO, KEY = "/ego/cam_front/rgb/image_raw/compressed", "/ego/cam_front/rgb/video", "cam_front/rgb"


def test_video_is_recorded_in_place_of_jpeg_and_nothing_else_changes(
    small_config: Callable[..., Path], tmp_path: Path
) -> None:
    pytest.importorskip("foxglove_msgs")
    config = small_config(0.3, without=["lidar", "radar", "gnss", "imu"])
    images, video = record_changed(config, tmp_path, "rate_hz: 10}\n", "rate_hz: 10, video: h264}\n")
    assert video.digests.keys() - images.digests.keys() == {VIDEO}
    assert images.digests.keys() - video.digests.keys() == {JPEG}
    compared = np.flatnonzero(images.scene.has([KEY]))
    assert len(compared) == 3 and np.array_equal(compared, np.flatnonzero(video.scene.has([KEY])))
    for tick in compared.tolist():
        assert np.abs(images.scene[tick][KEY].astype(int) - video.scene[tick][KEY]).mean() < 6
