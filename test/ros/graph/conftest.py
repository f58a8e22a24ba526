"""Fixtures for tests with running graphs: a small configuration, commands, and a check for leftovers."""

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import pytest
from commands import Command, Find, leaving_nothing, record, write_small
from marked_processes import marked_processes
from ros_domain import DOMAIN
from waiting import wait_until

from simbev_ros.ros.msgs.message_types import message_class


@pytest.fixture
def small_config(tmp_path: Path) -> Callable[..., Path]:
    """Function that writes a small configuration, as ``write_small``, into the test's folder."""
    return partial(write_small, tmp_path)


@pytest.fixture(scope="session")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The bag of half a second with the small configuration, as tables and typed messages."""
    folder = tmp_path_factory.mktemp("recorded")
    config = write_small(folder, more="recording: {forms: [tables, messages]}\n")
    return record(Command, config, folder / "dataset")


@pytest.fixture
def simbev() -> Iterator[Callable[..., Command]]:
    """Function that starts commands; those still running at the end of the test are ended."""
    commands: list[Command] = []

    def start(*arguments: object, **machine: int) -> Command:
        commands.append(Command(*arguments, **machine))
        return commands[-1]

    yield start
    for command in commands:
        command.close()


@pytest.fixture
def find(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Find]:
    """Function that finds processes of this test's commands by a part of their command line; none may be left."""
    monkeypatch.setenv("SIMBEV_TEST", str(tmp_path))
    mark = f"SIMBEV_TEST={tmp_path}".encode()
    yield lambda part: marked_processes(part, mark)
    wait_until(lambda: not marked_processes("simbev_ros.", mark))


@pytest.fixture(autouse=True)
def no_leftovers() -> Iterator[None]:
    """Check after every test that nothing of its graphs is left."""
    with leaving_nothing():
        yield


@pytest.fixture(scope="session")
def ros_type_hashes() -> dict[str, str]:
    """Type hashes of installed message types, as announced by rclpy's own publishers."""
    import rclpy
    from rclpy.context import Context

    context = Context()
    rclpy.init(context=context, domain_id=DOMAIN)
    node = rclpy.create_node("hashes", context=context)
    hashes = {}
    try:
        for type_name in (
            "sensor_msgs/msg/PointCloud2",
            "sensor_msgs/msg/CompressedImage",
            "sensor_msgs/msg/CameraInfo",
            "sensor_msgs/msg/Imu",
            "sensor_msgs/msg/NavSatFix",
            "nav_msgs/msg/Odometry",
            "visualization_msgs/msg/MarkerArray",
            "std_msgs/msg/String",
            "rosgraph_msgs/msg/Clock",
        ):
            topic = "/" + type_name.replace("/", "_")
            node.create_publisher(message_class(type_name), topic, 1)
            wait_until(lambda topic=topic: node.get_publishers_info_by_topic(topic))
            hashes[type_name] = str(node.get_publishers_info_by_topic(topic)[0].topic_type_hash)
    finally:
        node.destroy_node()
        context.shutdown()
    return hashes
