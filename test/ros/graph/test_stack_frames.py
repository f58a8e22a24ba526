"""A recorded scene has what the pages on Autoware and Nav2 promise: one tree of frames, covariances, clouds."""

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from guide_tables import page, quoted, rows
from rosbags.highlevel import AnyReader

from simbev_ros.ros.msgs.tables import table_from_message
from simbev_ros.ros.relays.autoware_points import autoware_points

pytestmark = pytest.mark.graph


@cache
def messages(bag: Path) -> dict[str, list[Any]]:
    """Messages of a bag by topic, read by rosbags."""
    found: dict[str, list[Any]] = {}
    with AnyReader([bag]) as reader:
        for connection, _, payload in reader.messages():
            found.setdefault(connection.topic, []).append(reader.deserialize(payload, connection.msgtype))
    return found


def parents(bag: Path) -> dict[str, str]:
    """Parent of each frame."""
    found: dict[str, str] = {}
    for topic in ("/tf", "/tf_static"):
        for message in messages(bag)[topic]:
            for each in message.transforms:
                parent = found.setdefault(each.child_frame_id, each.header.frame_id)
                assert parent == each.header.frame_id, f"{each.child_frame_id} has two parents"
    return found


def ancestors(frame: str, tree: dict[str, str]) -> list[str]:
    """The frames from which a frame descends, the root last."""
    found: list[str] = []
    while frame in tree:
        found.append(frame := tree[frame])
    return found


def served() -> set[str]:
    """Our topics that the pages name, as they are called in the recorded scene."""
    pages = {"autoware": "Autoware's topic", "nav2": "Nav2's topic"}
    names = {quoted(cells[3]) for name, heading in pages.items() for cells in rows(page(name), heading)}
    return {name.replace("/camera0/", "/cam_front/") for name in names if name and name.startswith("/")}


def test_every_header_names_a_frame_below_map(recorded: Path) -> None:
    tree, stamped = parents(recorded), 0
    own = {topic for topic in messages(recorded) if topic.startswith("/ego/")}
    for topic in own | served() & messages(recorded).keys():
        for message in messages(recorded)[topic]:
            if hasattr(message, "header"):
                stamped += 1
                assert "map" in (message.header.frame_id, *ancestors(message.header.frame_id, tree))
    assert stamped > 0


def test_the_static_transform_of_the_page_joins_base_link_to_the_tree(recorded: Path) -> None:
    joined = parents(recorded) | {"base_link": "ego/base_link"}
    assert ancestors("base_link", joined)[-2:] == ["map", "earth"]
    assert f"--frame-id {joined['base_link']} --child-frame-id base_link" in page("autoware")


def test_odometry_is_the_pose_of_the_frame_that_tf_moves(recorded: Path) -> None:
    moved = {each.child_frame_id for message in messages(recorded)["/tf"] for each in message.transforms}
    assert {message.child_frame_id for message in messages(recorded)["/ego/odom"]} <= moved


def test_imu_and_gnss_say_how_exact_they_are(recorded: Path) -> None:
    for message in messages(recorded)["/ego/imu/data_raw"]:
        assert message.orientation_covariance[0] == -1  # REP-145: there is none
        assert message.angular_velocity_covariance[0] > 0 and message.linear_acceleration_covariance[0] > 0
    for message in messages(recorded)["/ego/gnss/fix"]:
        assert message.status.status >= 0 and message.position_covariance_type == message.COVARIANCE_TYPE_KNOWN


def test_camera_info_describes_the_images_beside_it(recorded: Path) -> None:
    for info in messages(recorded)["/ego/cam_front/camera_info"]:
        assert (info.width, info.height, info.distortion_model) == (96, 64, "plumb_bob")
        assert info.k[0] > 0 and info.p[0] == info.k[0]


def test_clouds_convert_to_autowares_points(recorded: Path) -> None:
    for cloud in messages(recorded)["/ego/lidar/points"]:
        points = table_from_message(cloud)
        converted, first_ns = autoware_points(points, rolling=True)
        assert len(converted) == len(points) > 0 and -60_000_000 < first_ns <= 0
        np.testing.assert_allclose(
            converted["distance"], np.linalg.norm([points[axis] for axis in "xyz"], axis=0), rtol=1e-5
        )
