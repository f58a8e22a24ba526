"""Tests of the ground truth at the time of a picture, from messages of other times."""

from pathlib import Path

import numpy as np
import pytest
from box_tables import box
from made_up_scene import made_up_spec
from ros_messages import image, odometry, point_cloud

from simbev_ros.dataset import open_dataset
from simbev_ros.foundation.geometry.transforms import rotations_from_rpy
from simbev_ros.foundation.types import Float64Array
from simbev_ros.recording.bag_writer import SceneBagWriter
from simbev_ros.recording.layout import SCENE_ATTACHMENT
from simbev_ros.recording.qos import QosProfile
from simbev_ros.show.sheet.frames import FrameReader, SheetFrame
from simbev_ros.show.sheet.views import find_views

RGB, BOXES, ODOMETRY, BEV = "cam_front/rgb", "boxes", "odom", "bev/labels"
TYPES = {RGB: "sensor_msgs/msg/Image", BOXES: "sensor_msgs/msg/PointCloud2", BEV: "sensor_msgs/msg/Image"}


def rpy(tick: int) -> Float64Array:
    return np.array([0.02, -0.03, 0.1 * tick])


def frames(path: Path, ticks: dict[str, list[int]]) -> list[SheetFrame]:
    """Sheet frames of a bag with values that contain their ticks."""
    spec = made_up_spec([{"type": "camera", "name": "cam_front", "width_px": 16, "height_px": 16}], ticks=50)
    with SceneBagWriter(path) as writer:
        writer.add_attachment(SCENE_ATTACHMENT, "application/json", spec.model_dump_json().encode())
        for key, own_ticks in ticks.items():
            topic = f"/ego/{key}/image_raw" if key == RGB else f"/ego/{key}"
            writer.add_topic(topic, TYPES.get(key, "nav_msgs/msg/Odometry"), QosProfile())
            for tick in own_ticks:
                stamp_ns = spec.stamp_ns(tick)
                data = {
                    RGB: lambda t=stamp_ns, n=tick: image(t, "rgb8", np.full((2, 4, 3), n, np.uint8)),
                    BEV: lambda t=stamp_ns, n=tick: image(t, "mono16", np.full((4, 4), n, np.uint16)),
                    BOXES: lambda t=stamp_ns, n=tick: point_cloud(t, box(n, 0.0, 0.0)),
                    ODOMETRY: lambda t=stamp_ns, n=tick: odometry(t, np.array([n, 2, 3]), rpy(n)),
                }[key]()
                writer.write(topic, stamp_ns, data)
        writer.finish({})
    [scene] = open_dataset(path).scenes
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
    assert camera[3].map_from_ego[:3, :3] == pytest.approx(rotations_from_rpy(rpy(3)))


def test_older_labels_are_level_at_the_egos_pose_at_their_stamp(tmp_path: Path) -> None:
    truth = frames(tmp_path / "a", {RGB: [4], BEV: [2], BOXES: [1], ODOMETRY: [0, 1, 2, 3, 4]})[-1].truths[RGB]
    assert truth.labels is not None and truth.labels[0, 0] == 2
    assert truth.map_from_grid[:3, 3].tolist() == [2, 2, 3]
    assert truth.map_from_grid[:3, :3] == pytest.approx(rotations_from_rpy(np.array([0, 0, 0.2])))
    assert truth.map_from_ego[0, 3] == 4
    assert truth.boxes is not None and truth.boxes["x"].tolist() == [1]


def test_ground_truth_of_a_silent_topic_expires(tmp_path: Path) -> None:
    images = list(range(0, 50, 2))
    everything = frames(tmp_path / "a", {RGB: images, BOXES: [0], ODOMETRY: list(range(40)), BEV: [1]})
    held = {frame.ticks[RGB]: frame.truths.get(RGB) for frame in everything}
    assert held[0] is not None and held[0].labels is None
    assert held[20] is not None and held[20].boxes is not None
    assert held[22] is not None and held[22].boxes is None and held[22].labels is None
    assert held[38] is not None and held[40] is None, "a pose of another time would be wrong"


def test_without_the_egos_pose_there_is_no_ground_truth(tmp_path: Path) -> None:
    (frame,) = frames(tmp_path / "a", {RGB: [0], BOXES: [0]})
    assert not frame.truths
