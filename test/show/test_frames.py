from pathlib import Path

import numpy as np
import pytest
from ros_messages import image, string

from simbev_ros.dataset.opened import open_bag
from simbev_ros.foundation.errors import BagError
from simbev_ros.recording.bag_writer import SceneBagWriter
from simbev_ros.recording.qos import QosProfile
from simbev_ros.show.sheet.frames import FrameReader
from simbev_ros.show.sheet.views import find_views

TICK_NS = 50_000_000
FAST, SLOW = "/ego/cam_back/rgb/image_raw", "/ego/cam_front/rgb/image_raw"


def write_images(path: Path, stamps: dict[str, list[int]]) -> Path:
    with SceneBagWriter(path) as writer:
        for topic, ticks in stamps.items():
            writer.add_topic(topic, "sensor_msgs/msg/Image", QosProfile())
            for tick in ticks:
                picture = np.full((2, 4, 3), tick, np.uint8)
                writer.write(topic, tick * TICK_NS, image(tick * TICK_NS, "rgb8", picture))
        return writer.finish({})


def test_cameras_come_in_panorama_order_and_the_front_one_is_main(tmp_path: Path) -> None:
    names = ["roof", "cam_back", "cam_back_left", "cam_front", "cam_front_left"]
    path = write_images(
        tmp_path / "a",
        {f"/ego/{n}/{m}/image_raw": [0] for n in names for m in ("rgb", "depth") if (n, m) != ("roof", "depth")},
    )
    bag = open_bag(path)
    views = find_views(bag)
    assert list(views.cameras) == ["cam_front_left", "cam_front", "cam_back_left", "cam_back", "roof"]
    assert views.main_camera == "cam_front"
    assert views.modalities == {"depth": "/ego/cam_front/depth/image_raw"}


def test_a_slower_sensor_is_shown_with_its_last_sample(tmp_path: Path) -> None:
    path = write_images(tmp_path / "a", {FAST: [0, 1, 2, 3], SLOW: [0, 2]})
    bag = open_bag(path)
    reader = FrameReader(bag, find_views(bag))
    frames = list(reader.frames(0, 4))
    late = list(reader.frames(3, 1))
    assert [int(frame.arrays[FAST][0, 0, 0]) for frame in frames] == [0, 1, 2, 3]
    assert [int(frame.arrays[SLOW][0, 0, 0]) for frame in frames] == [0, 0, 2, 2]
    assert [(f.index, int(f.arrays[SLOW][0, 0, 0]), int(f.arrays[FAST][0, 0, 0])) for f in late] == [(3, 2, 3)]
    assert reader.rate_hz == 20


def test_a_silent_sensor_is_left_out(tmp_path: Path) -> None:
    path = write_images(tmp_path / "a", {FAST: list(range(30)), SLOW: [0]})
    bag = open_bag(path)
    frames = list(FrameReader(bag, find_views(bag)).frames(0, 30))
    assert SLOW in frames[20].arrays and SLOW not in frames[21].arrays


def test_a_bag_without_topics_to_show_is_refused(tmp_path: Path) -> None:
    with SceneBagWriter(tmp_path / "a") as writer:
        writer.add_topic("/words", "std_msgs/msg/String", QosProfile())
        writer.write("/words", 0, string("nothing to see"))
        path = writer.finish({})
    bag = open_bag(path)
    with pytest.raises(BagError, match="no images, semantic points"):
        find_views(bag)
