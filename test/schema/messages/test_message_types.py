"""Definitions and type hashes of this project's messages, against ROS's own generator and foreign readers' parsers."""

import json
import sysconfig
from pathlib import Path

import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.base import TypesysError

from simbev_ros.foundation.installation.interface_files import OWN_PACKAGE, interface_files, interface_folder
from simbev_ros.schema.messages.message_types import is_known_type, message_definition, type_hash, types_with

MESSAGES = [name for name in interface_files(OWN_PACKAGE) if "/msg/" in name]
DEPENDENCIES = ("builtin_interfaces", "geometry_msgs", "std_msgs")


@pytest.fixture(scope="module")
def hashes_by_ros(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Hashes of our messages that ROS's generator computes."""
    adapter = pytest.importorskip("rosidl_adapter.msg")
    generator = pytest.importorskip("rosidl_generator_type_description")
    folder, share = tmp_path_factory.mktemp("hashes"), Path(sysconfig.get_path("data"), "share")
    source = interface_folder(OWN_PACKAGE)
    for name in MESSAGES:
        file = Path(*name.split("/")[1:]).with_suffix(".msg")
        adapter.convert_msg_to_idl(source, OWN_PACKAGE, file, folder / "msg")
    arguments = {
        "package_name": OWN_PACKAGE,
        "output_dir": str(folder / "out"),
        "idl_tuples": [f"{folder}:msg/{name.rpartition('/')[2]}.idl" for name in MESSAGES],
        "include_paths": [f"{package}:{share / package}" for package in DEPENDENCIES],
    }
    (folder / "arguments.json").write_text(json.dumps(arguments))
    files = generator.generate_type_hash(str(folder / "arguments.json"))
    listed = [json.loads(Path(file).read_text())["type_hashes"] for file in files]
    return {each["type_name"]: each["hash_string"] for hashes in listed for each in hashes}


def test_type_hashes_are_those_of_ros(hashes_by_ros: dict[str, str]) -> None:
    assert len(MESSAGES) == 18
    assert {name: type_hash(name) for name in MESSAGES} == {name: hashes_by_ros[name] for name in MESSAGES}


@pytest.mark.parametrize("name", MESSAGES)
def test_a_definition_is_all_that_a_reader_needs(name: str) -> None:
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(message_definition(name), name))
    known = types_with(name)
    assert {each: fields for each, (_, fields) in store.fielddefs.items()} == {
        each: known.fielddefs[each][1] for each in store.fielddefs
    }


def test_a_definition_keeps_the_comments_with_units() -> None:
    definition = message_definition("simbev_interfaces/msg/Actors")
    assert "MSG: simbev_interfaces/Actor\n# A vehicle, rider, pedestrian or prop" in definition
    assert "# rad, angle of the front wheels, left positive" in definition


def test_definitions_of_ros_are_as_before() -> None:
    name = "nav_msgs/msg/Odometry"
    store = get_typestore(Stores.ROS2_JAZZY)
    assert message_definition(name) == store.generate_msgdef(name, ros_version=2)[0]
    assert type_hash(name) == store.hash_rihs01(name)


@pytest.mark.parametrize(
    ("name", "known"),
    [
        ("std_msgs/msg/String", True),
        ("simbev_interfaces/msg/Scene", True),
        ("vision_msgs/msg/Detection3DArray", True),
        ("simbev_interfaces/msg/Nothing", False),
        ("own_msgs/msg/Own", False),
        ("", False),
    ],
)
def test_known_types_are_those_of_jazzy_and_of_the_package(name: str, known: bool) -> None:
    assert is_known_type(name) is known
    if not known:
        with pytest.raises(TypesysError, match="unknown"):
            message_definition(name)
