"""Definitions of messages, services and actions in this package: its own, and those of ROS packages without wheels."""

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

from simbev_ros.foundation.installation.shipped_files import shipped_folder

OWN_PACKAGE = "simbev_interfaces"
"""The ROS package of this project's own interfaces, in ``interfaces/`` of a checkout."""
_KINDS = ("msg", "srv", "action")
_DEFINITIONS = Path(__file__).with_name("definitions")

FOREIGN_PACKAGES = tuple(sorted(folder.name for folder in _DEFINITIONS.glob("*_*s")))
"""ROS packages with definitions in the folder ``definitions`` next to this module."""
AUTOWARE_PACKAGES = tuple(name for name in FOREIGN_PACKAGES if name.startswith("autoware_"))
"""Those that only the relay for Autoware needs."""


def interface_folder(package: str) -> Path:
    """Folder of a package's definitions, which has the subfolders ``msg``, ``srv`` and ``action`` as far as needed.

    Args:
        package: ``OWN_PACKAGE`` or one of ``FOREIGN_PACKAGES``.

    Raises:
        FileNotFoundError: The installation is incomplete.
        KeyError: There is no such package.
    """
    if package == OWN_PACKAGE:
        return shipped_folder("interfaces", "msg/Actor.msg")
    if package not in FOREIGN_PACKAGES:
        raise KeyError(package)
    return _DEFINITIONS / package


def interface_files(package: str) -> Mapping[str, Path]:
    """Files of a package's definitions by full name, such as ``vision_msgs/msg/LabelInfo``, sorted.

    Raises:
        FileNotFoundError: As ``interface_folder``.
        KeyError: As ``interface_folder``.
    """
    folder = interface_folder(package)
    files = sorted(path for kind in _KINDS for path in folder.glob(f"{kind}/*.{kind}"))
    return MappingProxyType({f"{package}/{path.parent.name}/{path.stem}": path for path in files})
