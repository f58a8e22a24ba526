"""Definitions of messages in the package, against ROS's own parser and the hashes of the real packages."""

import json
import sys
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from enum import IntEnum, IntFlag
from pathlib import Path
from typing import Any

import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from simbev_ros.foundation.installation.interface_files import (
    AUTOWARE_PACKAGES,
    FOREIGN_PACKAGES,
    OWN_PACKAGE,
    interface_files,
    interface_folder,
)
from simbev_ros.foundation.semantics import BOX_CLASSES, DIFFICULTIES, SIGN_TYPES, Tag
from simbev_ros.schema.boxes import LIGHT_IDS, NO_BLUEPRINT, SIGN_IDS
from simbev_ros.schema.messages.message_types import type_hash
from simbev_ros.schema.scene.state import EGO_ID, Behavior, Light, SignalState

ROOT = Path(__file__).parents[3]
parser = pytest.importorskip("rosidl_adapter.parser")
PARSERS: dict[str, Callable[[str, str], Any]] = {
    "msg": parser.parse_message_file,
    "srv": parser.parse_service_file,
    "action": parser.parse_action_file,
}
PUBLISHED_HASHES = {
    "vision_msgs/msg/Detection2DArray": "214274120007f4a683866481336b70310268cfa107aebe9d594a6acf75bda968",
    "vision_msgs/msg/Detection3DArray": "793f5eab9595ac1c0da07873cc859db42eae51f0ee76056db8562515d830e018",
    "vision_msgs/msg/LabelInfo": "3d37df4015cdf660cc851c51897f2acd957e1ca6205ba0a99aebffb9406b0783",
    "vision_msgs/msg/VisionClass": "1e4a11f0fed50b5623cb8ff26ca0e37952a48a9c074d16f804b44e9164c2037a",
    "vision_msgs/msg/VisionInfo": "95d3116a17484ad91c9a2686e1d54890bbfc3ff6c6a2de137738c4950d45d284",
}
"""Hashes in the code that ROS 2's generators made of the package vision_msgs, as found in public workspaces."""
GPS_FIX_HASH = "f4e11a63872a198f70300a3990f50b096ed822f2db2bb626f6cdcee5f0f92942"
"""Likewise of gps_msgs/msg/GPSFix, which contains gps_msgs/msg/GPSStatus."""
SIMULATION_HASHES = {
    "msg/Bounds": "e8624fe51f0f5548197542697d924c5699ac7198f1e4c68e50c3ca2af73f5b3f",
    "msg/Result": "cf43a306adff3337a0a47143d8f5689933bc70a30478f13b077dc1fe3bc5ad17",
    "msg/SimulationState": "bb9f87ccdd98fba113052a512d9801e84ce732d0a2b3c2b0cb281828de36e415",
    "srv/GetAvailableWorlds": "ce5589b5523f2732d1969a3c5a7e6b17a387091df8190c62f78d7fdd1109e3e3",
    "srv/GetEntitiesStates": "0a76170d0c1c90e1eaf805cfab78ea801d1f82df309a28c1f0fae4b570f19754",
    "srv/GetNamedPoses": "c3d12ab920115bfd4733f6d20516adc3968fb438538540997c37e200e02b04e3",
    "srv/GetSpawnables": "3e25fd827d8bcbd9db5e36ccb190efa22d6f6313897861268ab923bf091a992a",
    "srv/LoadWorld": "87d0ded1bfddb40a74d0bedb963fdd592fbedb14d0057d597850404b73c338af",
    "srv/ResetSimulation": "4ce285d7ff9b8ac70dcc95161f32bf54c05a6f4b13427990e41ab40c36c39646",
    "srv/SpawnEntity": "66860313e11009faddbfc8568e5d410d1a11607fe75eeb1308671dc0406fe3a7",
    "srv/StepSimulation": "913fe0653690ce6bf8f09f316e6a626747012e9fca31e26719910d417aa8565c",
}
"""Likewise of the package simulation_interfaces 2; each covers the types that it refers to."""
AUTOWARE_HASHES = {
    "control_msgs/msg/Control": "7818be59aa790ebb777db06e55a2c15e3756de4cc35c80b1e8271afc5bab2e9d",
    "control_msgs/msg/Lateral": "94d39634041a92db4e460dae93def564fbeb89142e9c64f9c2ed540a182935a1",
    "control_msgs/msg/Longitudinal": "4ac4a6b5085ee6bb12067b763568abbf68ec3f2baf64b49e1da360aa6413edc1",
    "vehicle_msgs/msg/ControlModeReport": "968feaa6441be3c3b161f2eb65972a4b15394d0a7ddc4664318551280d1ff222",
    "vehicle_msgs/msg/Engage": "a865a0a669052a5bb45be203266058660ae8b3be8d080c4567f78d8174f4849e",
    "vehicle_msgs/msg/GearCommand": "4aa982c6505fafa9bdca2d243d0a71e46ff9a1e7013767f13a533d0a5d30a1a6",
    "vehicle_msgs/msg/GearReport": "4d14bc3f186c1a6af6a732bb5ebd540cdd742a56770012f4c3cb9e762de8f391",
    "vehicle_msgs/msg/HazardLightsCommand": "ad2386a78a210625f1fb35f8043ef4e78da58cf01f33c340fa9468e5e8cdd0bc",
    "vehicle_msgs/msg/HazardLightsReport": "01ce3b4293a5c2799fd7483b2d62a790e26fe8f2b5d60e48149163475685f28a",
    "vehicle_msgs/msg/SteeringReport": "aa3acc9ca95ebc4daf9dec0ecf87911ad9c196392857c3026bfead589db65a94",
    "vehicle_msgs/msg/TurnIndicatorsCommand": "657d7f761a9b02c543e4bf3e0000405906b6169dc0bbfd6637c64fe00d98cec7",
    "vehicle_msgs/msg/TurnIndicatorsReport": "c05a54cd244f1c9d683613b11c87a5b3ef816eed7a5f207368301221731a0964",
    "vehicle_msgs/msg/VelocityReport": "9052adda949c32f4a98500abc1fb5bd23f2560e321eebdfbb25318d6108d4ce4",
}
"""Likewise of Autoware's packages, as CARLA's native interface for ROS 2 announces them."""
ALL_FILES = [(kind, path) for name in (OWN_PACKAGE, *FOREIGN_PACKAGES) for kind, path in interface_files(name).items()]


def constants_of(message: str) -> dict[str, int]:
    """Values of the whole-number constants of one of our messages, as ROS reads them."""
    spec = parser.parse_message_file(OWN_PACKAGE, str(interface_folder(OWN_PACKAGE) / f"msg/{message}.msg"))
    return {each.name: each.value for each in spec.constants if isinstance(each.value, int)}


def members(prefix: str, numbers: type[IntEnum | IntFlag]) -> dict[str, int]:
    return {f"{prefix}_{member.name}": int(member) for member in numbers}


def numbered(prefix: str, names: tuple[str, ...]) -> dict[str, int]:
    return {f"{prefix}_{name.upper() or 'NONE'}": index for index, name in enumerate(names)}


@pytest.mark.parametrize(("name", "path"), ALL_FILES, ids=[name for name, _ in ALL_FILES])
def test_ros_parses_every_definition(name: str, path: Path) -> None:
    package, kind, _ = name.split("/")
    assert PARSERS[kind](package, str(path)) is not None


def test_every_field_of_ours_has_a_comment() -> None:
    for path in interface_files(OWN_PACKAGE).values():
        for line in path.read_text(encoding="utf-8").splitlines():
            code, _, comment = line.partition("#")
            assert comment or "=" in code or code.strip() in ("", "---"), f"{path.name}: {line}"


def test_the_build_names_every_definition_and_nothing_else() -> None:
    text = (ROOT / "interfaces/CMakeLists.txt").read_text(encoding="utf-8")
    named = [line.strip().strip('"') for line in text.splitlines() if line.strip().startswith('"')]
    folder = interface_folder(OWN_PACKAGE)
    assert named == sorted(str(path.relative_to(folder)) for path in interface_files(OWN_PACKAGE).values())


def test_both_packages_have_the_same_version_and_addresses() -> None:
    ours, interfaces = (ElementTree.parse(ROOT / path).getroot() for path in ("package.xml", "interfaces/package.xml"))
    for tag in ("version", "license", "maintainer", "url[@type='repository']"):
        assert interfaces.findtext(tag) == ours.findtext(tag), tag
    assert interfaces.findtext("name") == OWN_PACKAGE


def test_constants_of_actors_are_those_of_the_tables() -> None:
    expected = members("LIGHT", Light) | members("BEHAVIOR", Behavior) | members("TAG", Tag) | {"EGO_ID": EGO_ID}
    assert constants_of("Actor") == expected


def test_constants_of_traffic_signals_are_those_of_the_tables() -> None:
    assert constants_of("TrafficSignal") == members("STATE", SignalState)


def test_constants_of_boxes_are_those_of_the_tables() -> None:
    names = numbered("CLASS", BOX_CLASSES) | numbered("DIFFICULTY", DIFFICULTIES) | numbered("SIGN", SIGN_TYPES)
    ids = {"LIGHT_IDS": LIGHT_IDS, "SIGN_IDS": SIGN_IDS, "NO_BLUEPRINT": NO_BLUEPRINT}
    assert constants_of("Box") == names | ids


def test_type_hashes_of_vision_msgs_are_those_of_the_real_package() -> None:
    store = get_typestore(Stores.ROS2_JAZZY)
    for name, path in interface_files("vision_msgs").items():
        store.register(get_types_from_msg(path.read_text(encoding="utf-8"), name))
    assert {name: store.hash_rihs01(name) for name in PUBLISHED_HASHES} == {
        name: f"RIHS01_{digest}" for name, digest in PUBLISHED_HASHES.items()
    }


def test_the_type_hash_of_a_gps_fix_is_that_of_the_real_package() -> None:
    assert type_hash("gps_msgs/msg/GPSFix") == f"RIHS01_{GPS_FIX_HASH}"


def test_type_hashes_of_autoware_are_those_of_the_real_packages() -> None:
    store = get_typestore(Stores.ROS2_JAZZY)
    files = {name: path for package in AUTOWARE_PACKAGES for name, path in interface_files(package).items()}
    types = [get_types_from_msg(path.read_text(), name) for name, path in files.items() if path.suffix == ".msg"]
    store.register({name: fields for each in types for name, fields in each.items()})
    assert {name: store.hash_rihs01(f"autoware_{name}") for name in AUTOWARE_HASHES} == {
        name: f"RIHS01_{digest}" for name, digest in AUTOWARE_HASHES.items()
    }


def test_type_hashes_of_simulation_interfaces_are_those_of_the_real_package() -> None:
    share = Path(sys.prefix, "share", "simulation_interfaces")
    if not share.is_dir():
        pytest.skip("the package is not installed")
    made = {
        each["type_name"]: each["hash_string"]
        for name in SIMULATION_HASHES
        for each in json.loads((share / f"{name}.json").read_text())["type_hashes"]
    }
    assert {name: made[f"simulation_interfaces/{name}"] for name in SIMULATION_HASHES} == {
        name: f"RIHS01_{digest}" for name, digest in SIMULATION_HASHES.items()
    }


def test_fields_of_tf2_msgs_are_those_that_rosbags_knows_of_jazzy() -> None:
    store = get_typestore(Stores.ROS2_JAZZY)
    for name in ("tf2_msgs/msg/TFMessage", "tf2_msgs/msg/TF2Error"):
        text = interface_files("tf2_msgs")[name].read_text(encoding="utf-8")
        assert get_types_from_msg(text, name)[name] == store.fielddefs[name]


def test_a_package_without_definitions_is_refused() -> None:
    with pytest.raises(KeyError, match="nav_msgs"):
        interface_folder("nav_msgs")
