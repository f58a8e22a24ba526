"""Fixtures for tests with running graphs: a small configuration, commands, and a check for leftovers."""

from collections.abc import Callable, Collection, Iterator
from contextlib import suppress
from pathlib import Path

import pytest
from commands import SMALL, Command, is_alone, node_processes, orphaned_files, record
from ros_domain import DOMAIN
from waiting import wait_until

from simbev_ros.ros.msgs.message_types import message_class


@pytest.fixture
def small_config(tmp_path: Path) -> Callable[..., Path]:
    """Function that writes a small configuration of a given duration, with further text appended.

    Kinds of sensors that a test does not need can be left out: their processes take the longest to start.
    """

    def write(duration_s: float = 0.5, more: str = "", name: str = "small.yaml", without: Collection[str] = ()) -> Path:
        path = tmp_path / name
        lines = SMALL.replace("DURATION", f"{duration_s:g}").splitlines(keepends=True)
        path.write_text("".join(line for line in lines if not any(f"type: {kind}," in line for kind in without)) + more)
        return path

    return write


@pytest.fixture(scope="session")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The bag of a scene of half a second with the small configuration."""
    folder = tmp_path_factory.mktemp("recorded")
    (folder / "small.yaml").write_text(SMALL.replace("DURATION", "0.5"))
    return record(Command, folder / "small.yaml", folder / "dataset")


@pytest.fixture(scope="session")
def in_both_forms(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same scene, recorded as tables and as typed messages; another one follows on the same processes."""
    folder = tmp_path_factory.mktemp("in_both_forms")
    text = SMALL.replace("DURATION", "0.5").replace("train: 1", "train: 2") + "recording: {forms: [tables, messages]}\n"
    (folder / "small.yaml").write_text(text)
    return record(Command, folder / "small.yaml", folder / "dataset")


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


@pytest.fixture(autouse=True)
def no_leftovers() -> Iterator[None]:
    """Check after every test that no node process runs, and that there is no new file of the middleware in /dev/shm.

    The files do not say whose they are, so they are not checked while other graphs run on the machine.
    """
    before = orphaned_files()
    yield
    with suppress(AssertionError):
        wait_until(lambda: not node_processes() and (not orphaned_files() - before or not is_alone()), 30)
    assert not node_processes()
    assert not orphaned_files() - before or not is_alone()


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
