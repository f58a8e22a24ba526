"""Message packages are made of their definitions: code that sends, the type's hash, and one line if it fails."""

import base64
import hashlib
import json
import os
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from simbev_ros.foundation.errors import SimbevError
from simbev_ros.foundation.installation.message_packages import installer, libraries
from simbev_ros.foundation.installation.message_packages.definitions import (
    AUTOWARE_MESSAGES,
    MESSAGE_PACKAGES,
    MessagePackage,
)

needs_compiler = pytest.mark.skipif(
    not installer.is_possible() or libraries.find_compiler_problem() is not None,
    reason="ROS is not from wheels, or there is no compiler",
)

READING = "std_msgs/Header header\ngeometry_msgs/Point[] points\nfloat64[4] weights\nstring name\n"
ASKING = "string question\n---\nstring answer\n"
SAME_NAME = "Reading reading\n---\n"
USE = """
from made_up_msgs.msg import Reading
from made_up_msgs.srv import Asking, Reading as OfService
from geometry_msgs.msg import Point
from rclpy.serialization import deserialize_message, serialize_message

sent = Reading(points=[Point(x=1.0), Point(y=2.5)], weights=[1.0, 2.0, 3.0, 4.0], name="made up")
sent.header.frame_id = "map"
payload = serialize_message(sent)
assert deserialize_message(payload, Reading) == sent
assert Asking.Request(question="?").question == "?"
assert OfService.Request(reading=sent).reading == sent
print(payload.hex())
"""


class MadeUp(MessagePackage):
    """A package whose definitions a test has written."""

    def __init__(self, folder: Path) -> None:
        super().__init__("made_up_msgs", "1.2.3", "Apache-2.0", "nothing")
        object.__setattr__(self, "_folder", folder)

    __slots__ = ("_folder",)

    @property
    def folder(self) -> Path:
        """The folder that the test has written to."""
        return self._folder  # type: ignore[attr-defined,no-any-return]

    def definitions(self) -> list[Path]:
        """All definitions in it."""
        return sorted(path.relative_to(self.folder) for path in self.folder.glob("*/*.*"))


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> MadeUp:
    folder = tmp_path_factory.mktemp("definitions")
    for path, text in (("msg/Reading.msg", READING), ("srv/Asking.srv", ASKING), ("srv/Reading.srv", SAME_NAME)):
        (folder / path).parent.mkdir(exist_ok=True)
        (folder / path).write_text(text)
    return MadeUp(folder)


@pytest.fixture(scope="module")
def installed(package: MadeUp, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The unpacked wheel of the made-up package."""
    from simbev_ros.foundation.installation.message_packages.sources import generate_sources
    from simbev_ros.foundation.installation.message_packages.wheel import pack_wheel

    folder = tmp_path_factory.mktemp("made")
    sources = generate_sources(package, folder)
    libraries.compile_libraries(package.name, sources, folder / "lib")
    wheel = pack_wheel(package, "1.2.3+4", sources, folder / "lib", folder)
    zipfile.ZipFile(wheel).extractall(folder / "wheel")
    return folder / "wheel"


def data(installed: Path) -> Path:
    return installed / "simbev_built_made_up_msgs-1.2.3+4.data" / "data"


@needs_compiler
def test_messages_of_a_made_package_are_sent_as_rosbags_writes_them(installed: Path) -> None:
    libraries_path = f"{data(installed) / 'lib'}:{os.environ.get('LD_LIBRARY_PATH', '')}"
    environment = {**os.environ, "PYTHONPATH": str(installed), "LD_LIBRARY_PATH": libraries_path}
    done = subprocess.run([sys.executable, "-c", USE], env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    store = get_typestore(Stores.ROS2_JAZZY)
    store.register(get_types_from_msg(READING, "made_up_msgs/msg/Reading"))
    read: Any = store.deserialize_cdr(bytes.fromhex(done.stdout.strip()), "made_up_msgs/msg/Reading")
    assert (read.header.frame_id, read.name, list(read.weights)) == ("map", "made up", [1.0, 2.0, 3.0, 4.0])
    assert [(point.x, point.y) for point in read.points] == [(1.0, 0.0), (0.0, 2.5)]


@needs_compiler
def test_the_hash_of_a_made_type_is_that_of_its_definition(installed: Path) -> None:
    store = get_typestore(Stores.ROS2_JAZZY)
    store.register(get_types_from_msg(READING, "made_up_msgs/msg/Reading"))
    description = json.loads((data(installed) / "share" / "made_up_msgs" / "msg" / "Reading.json").read_text())
    hashes = {each["type_name"]: each["hash_string"] for each in description["type_hashes"]}
    assert hashes["made_up_msgs/msg/Reading"] == store.hash_rihs01("made_up_msgs/msg/Reading")


@needs_compiler
def test_the_wheel_records_its_files_and_lists_its_interfaces_for_ros(installed: Path) -> None:
    record = (installed / "simbev_built_made_up_msgs-1.2.3+4.dist-info" / "RECORD").read_text().splitlines()
    recorded = dict(line.split(",")[:2] for line in record)
    paths = [path for path in installed.rglob("*") if path.is_file() and path.suffix != ".pyc"]
    files = {path.relative_to(installed).as_posix(): path for path in paths}
    assert recorded.keys() == files.keys()
    for name, path in files.items():
        digest = base64.urlsafe_b64encode(hashlib.sha256(path.read_bytes()).digest()).rstrip(b"=").decode()
        assert recorded[name] in ("", f"sha256={digest}")
    index = data(installed) / "share" / "ament_index" / "resource_index"
    assert (index / "rosidl_interfaces" / "made_up_msgs").read_text().split() == [
        "msg/Reading.msg",
        "srv/Asking.srv",
        "srv/Reading.srv",
    ]
    assert (index / "packages" / "made_up_msgs").is_file()


@needs_compiler
def test_a_wrong_definition_is_named(tmp_path: Path) -> None:
    from simbev_ros.foundation.installation.message_packages.sources import generate_sources

    (tmp_path / "msg").mkdir()
    (tmp_path / "msg" / "Bad.msg").write_text("float65 value\n")
    with pytest.raises(ValueError, match=r"made_up_msgs: (?s:.*)float65"):
        generate_sources(MadeUp(tmp_path), tmp_path / "made")


@pytest.fixture
def outdated(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let no package be installed, on a machine where ROS comes from wheels."""
    versions: Callable[[str], str | None] = {"ros-rclpy": "7.1.6"}.get
    monkeypatch.setenv("SIMBEV_COMMAND", "./simbev")
    monkeypatch.setattr(installer, "_version", versions)
    monkeypatch.setattr(installer.util, "find_spec", lambda name: None)


@pytest.mark.usefixtures("outdated")
def test_without_a_compiler_the_packages_of_the_distribution_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(libraries.shutil, "which", lambda name: None)
    with pytest.raises(
        SimbevError,
        match=r"^tf2_msgs, .*, point_cloud_interfaces, simbev_interfaces cannot be made on this machine: no C",
    ):
        installer.install_missing()
    assert installer.describe_remedy() == "no C++ compiler: apt-get install g++ python3-dev, then ./simbev doctor --fix"


@pytest.mark.usefixtures("outdated")
def test_without_the_headers_of_python_they_are_asked_for(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(libraries.shutil, "which", lambda name: f"/usr/bin/{name}")
    monkeypatch.setattr(libraries.sysconfig, "get_path", lambda name: str(tmp_path))
    assert (
        installer.describe_remedy()
        == "no headers of Python: apt-get install g++ python3-dev, then ./simbev doctor --fix"
    )


@pytest.mark.usefixtures("outdated")
def test_set_up_does_not_make_what_few_need(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(libraries.shutil, "which", lambda name: None)
    made = [state.package.name for state in installer.survey_packages()]
    assert not {"autoware_control_msgs", "simulation_interfaces"} & set(made)
    with pytest.raises(SimbevError, match=r"^autoware_control_msgs, .*: no C\+\+ compiler: .*, then start it again$"):
        installer.install_missing(packages=AUTOWARE_MESSAGES)


def test_with_an_installed_ros_its_packages_are_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(installer, "_version", lambda name: None)
    monkeypatch.setattr(installer.util, "find_spec", lambda name: None)
    assert installer.describe_remedy() == (
        "apt-get install ros-jazzy-tf2-msgs ros-jazzy-vision-msgs ros-jazzy-radar-msgs ros-jazzy-gps-msgs "
        "ros-jazzy-ackermann-msgs ros-jazzy-foxglove-msgs ros-jazzy-point-cloud-interfaces; "
        "build the package in interfaces/ with colcon, and source it"
    )


def test_a_package_that_ros_brings_is_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(installer, "_version", lambda name: None)
    monkeypatch.setattr(installer.util, "find_spec", lambda name: object())
    assert all(state.is_current for state in installer.survey_packages())
    assert installer.install_missing() == []


def test_a_package_is_made_again_when_its_definitions_change(package: MadeUp, tmp_path: Path) -> None:
    (tmp_path / "msg").mkdir()
    (tmp_path / "msg" / "Reading.msg").write_text(READING)
    before = installer._wanted_version(MadeUp(tmp_path))
    assert before == installer._wanted_version(MadeUp(tmp_path))
    (tmp_path / "msg" / "Reading.msg").write_text(READING + "bool valid\n")
    assert before != installer._wanted_version(MadeUp(tmp_path))
    assert before.startswith("1.2.3+")


def test_every_package_has_definitions() -> None:
    names = {package.name: [path.as_posix() for path in package.definitions()] for package in MESSAGE_PACKAGES}
    assert "msg/TFMessage.msg" in names["tf2_msgs"]
    assert "msg/Detection3DArray.msg" in names["vision_msgs"]
    assert "msg/RadarScan.msg" in names["radar_msgs"]
    assert names["foxglove_msgs"] == ["msg/CompressedVideo.msg"]
    assert {"srv/LoadScene.srv", "action/RunScene.action"} < set(names["simbev_interfaces"])


def test_our_own_package_has_the_version_and_license_of_its_manifest() -> None:
    manifest = ElementTree.parse(Path(__file__).parents[3] / "interfaces" / "package.xml").getroot()
    (own,) = (package for package in MESSAGE_PACKAGES if package.name == manifest.findtext("name"))
    assert (own.version, own.license) == (manifest.findtext("version"), manifest.findtext("license"))
