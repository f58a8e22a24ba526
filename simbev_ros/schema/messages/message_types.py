"""Message types that bags contain: those that ROS 2 Jazzy ships, and those whose definitions come with this package.

The type stores are rosbags', so neither ROS nor generated code is needed. Definitions of this package are parsed when
one of their types is asked for.
"""

from functools import lru_cache

from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from simbev_ros.foundation.installation.interface_files import OWN_PACKAGE, interface_files

_JAZZY = get_typestore(Stores.ROS2_JAZZY)
_ADDED_PACKAGES = (OWN_PACKAGE, "vision_msgs", "radar_msgs", "gps_msgs", "foxglove_msgs", "point_cloud_interfaces")
_SEPARATOR = "=" * 80 + "\n"


def types_with(type_name: str) -> Typestore:
    """Store of message types that contains a type, such as ``sensor_msgs/msg/Image``, if it is known.

    Raises:
        FileNotFoundError: The installation is incomplete.
    """
    return _extended_types() if type_name.partition("/")[0] in _ADDED_PACKAGES else _JAZZY


def is_known_type(type_name: str) -> bool:
    """Whether a message type is one of ROS 2 Jazzy, of this project, or of a package whose definitions come with it."""
    return type_name in types_with(type_name).fielddefs


@lru_cache
def message_definition(type_name: str) -> str:
    """Definition of a known type, followed by those of all types in it, as MCAP's ``ros2msg`` wants it.

    Definitions of this package keep their comments, with units and frames.

    Raises:
        TypesysError: The type is unknown.
    """
    definition, _ = types_with(type_name).generate_msgdef(type_name, ros_version=2)
    first, *others = definition.split(_SEPARATOR)
    parts = [_source(type_name) or first]
    for part in others:
        name, _, body = part.removeprefix("MSG: ").partition("\n")
        package, _, kind = name.partition("/")
        parts.append(f"MSG: {name}\n{_source(f'{package}/msg/{kind}') or body}")
    return _SEPARATOR.join(parts)


def type_hash(type_name: str) -> str:
    """Hash of a known type's description (REP-2016), as in the metadata of bags.

    Raises:
        TypesysError: The type is unknown.
    """
    return types_with(type_name).hash_rihs01(type_name)


@lru_cache
def _extended_types() -> Typestore:
    """ROS 2 Jazzy's types and those of this package."""
    store = get_typestore(Stores.ROS2_JAZZY)
    for package in _ADDED_PACKAGES:
        for name in interface_files(package):
            if (text := _source(name)) is not None:
                store.register(get_types_from_msg(text, name))
    return store


def _source(type_name: str) -> str | None:
    """Text of a message's file in this package; None if there is none."""
    package = type_name.partition("/")[0]
    if package not in _ADDED_PACKAGES or "/msg/" not in type_name:
        return None
    return interface_files(package)[type_name].read_text(encoding="utf-8")
