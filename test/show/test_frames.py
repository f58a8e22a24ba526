"""Frames of a sheet: what is shown of a scene, and samples of slower sensors."""

from pathlib import Path

import numpy as np
import pytest
from made_up_scene import made_up_spec
from ros_messages import image, string

from simbev_ros.dataset import Scene, open_dataset
from simbev_ros.foundation.errors import BagError
from simbev_ros.recording.bag_writer import SceneBagWriter
from simbev_ros.recording.layout import SCENE_ATTACHMENT
from simbev_ros.recording.qos import QosProfile
from simbev_ros.show.sheet.frames import FrameReader
from simbev_ros.show.sheet.views import find_views

FAST, SLOW = "cam_back/rgb", "cam_front/rgb"


def write_images(path: Path, ticks_of: dict[str, list[int]]) -> Scene:
    """A scene with images that contain their ticks, at some ticks by key."""
    names = dict.fromkeys(key.partition("/")[0] for key in ticks_of)
    spec = made_up_spec([{"type": "camera", "name": name, "width_px": 16, "height_px": 16} for name in names], ticks=30)
    with SceneBagWriter(path) as writer:
        writer.add_attachment(SCENE_ATTACHMENT, "application/json", spec.model_dump_json().encode())
        writer.add_topic("/words", "std_msgs/msg/String", QosProfile())
        writer.write("/words", spec.start_ns, string("nothing to see"))
        for key, ticks in ticks_of.items():
            writer.add_topic(f"/ego/{key}/image_raw", "sensor_msgs/msg/Image", QosProfile())
            for tick in ticks:
                picture = np.full((2, 4, 3), tick, np.uint8)
                writer.write(f"/ego/{key}/image_raw", spec.stamp_ns(tick), image(spec.stamp_ns(tick), "rgb8", picture))
        writer.finish({})
    return open_dataset(path).scenes[0]


def test_cameras_come_in_panorama_order_and_the_front_one_is_main(tmp_path: Path) -> None:
    names = ["roof", "cam_back", "cam_back_left", "cam_front", "cam_front_left"]
    keys = [f"{n}/{m}" for n in names for m in ("rgb", "depth") if (n, m) != ("roof", "depth")]
    views = find_views(write_images(tmp_path / "a", {key: [0] for key in keys}))
    assert list(views.cameras) == ["cam_front_left", "cam_front", "cam_back_left", "cam_back", "roof"]
    assert views.main_camera == "cam_front"
    assert views.modalities == {"depth": "cam_front/depth"}


def test_a_slower_sensor_is_shown_with_its_last_sample(tmp_path: Path) -> None:
    scene = write_images(tmp_path / "a", {FAST: [0, 1, 2, 3], SLOW: [0, 2]})
    reader = FrameReader(scene, find_views(scene))
    frames = list(reader.frames(0, 4))
    late = list(reader.frames(3, 1))
    assert [int(frame.arrays[FAST][0, 0, 0]) for frame in frames] == [0, 1, 2, 3]
    assert [int(frame.arrays[SLOW][0, 0, 0]) for frame in frames] == [0, 0, 2, 2]
    assert [(f.index, int(f.arrays[SLOW][0, 0, 0]), int(f.arrays[FAST][0, 0, 0])) for f in late] == [(3, 2, 3)]
    assert reader.rate_hz == 20


def test_a_silent_sensor_is_left_out(tmp_path: Path) -> None:
    scene = write_images(tmp_path / "a", {FAST: list(range(30)), SLOW: [0]})
    frames = list(FrameReader(scene, find_views(scene)).frames(0, 30))
    assert SLOW in frames[20].arrays and SLOW not in frames[21].arrays


def test_a_bag_without_anything_to_show_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BagError, match="no images, semantic points"):
        find_views(write_images(tmp_path / "a", {}))
