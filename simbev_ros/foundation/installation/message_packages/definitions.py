"""The message packages that can be made, and the definitions that they are made of."""

import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from pathlib import Path

from simbev_ros.foundation.installation.interface_files import (
    AUTOWARE_PACKAGES,
    OWN_PACKAGE,
    interface_files,
    interface_folder,
)


@dataclass(frozen=True, slots=True)
class MessagePackage:
    """A ROS package of messages.

    Attributes:
        name: Name of the package.
        version: Its version.
        license: SPDX identifier.
        use: What works with it, for the report of ``simbev doctor``.
    """

    name: str
    version: str
    license: str
    use: str

    @property
    def distribution(self) -> str:
        """Name of its distribution, as in ``pip list``."""
        return f"simbev_built_{self.name}"

    @property
    def folder(self) -> Path:
        """Folder with its definitions in ``msg``, ``srv`` and ``action``."""
        return interface_folder(self.name)

    def definitions(self) -> list[Path]:
        """Paths of the definitions relative to the folder."""
        return [path.relative_to(self.folder) for path in interface_files(self.name).values()]

    def manifest(self) -> bytes:
        """Its package.xml, as far as tools read it from an installed package."""
        root = ElementTree.Element("package", format="3")
        for tag, text in (("name", self.name), ("version", self.version), ("license", self.license)):
            ElementTree.SubElement(root, tag).text = text
        ElementTree.SubElement(root, "member_of_group").text = "rosidl_interface_packages"
        ElementTree.indent(root)
        return ElementTree.tostring(root, xml_declaration=True, encoding="utf-8")


MESSAGE_PACKAGES = (
    MessagePackage("tf2_msgs", "0.36.14", "BSD-3-Clause", "/tf and /tf_static live"),
    MessagePackage("vision_msgs", "4.1.1", "Apache-2.0", "detections and label_info live"),
    MessagePackage("radar_msgs", "0.2.2", "Apache-2.0", "scans of radars live"),
    MessagePackage("gps_msgs", "2.1.0", "BSD-3-Clause", "extended fixes of GNSS live"),
    MessagePackage("ackermann_msgs", "2.0.2", "BSD-3-Clause", "commands of drivers with ackermann"),
    MessagePackage("foxglove_msgs", "3.1.0", "MIT", "video of cameras"),
    MessagePackage("point_cloud_interfaces", "4.0.2", "BSD-3-Clause", "compressed clouds of lidars"),
    MessagePackage(OWN_PACKAGE, "0.1.0", "Apache-2.0", "own messages live, own services and RunScene"),
)
"""Packages that set-up makes."""
AUTOWARE_MESSAGES = tuple(
    MessagePackage(name, "1.11.0", "Apache-2.0", "driving by Autoware's topics") for name in AUTOWARE_PACKAGES
)
SERVED_MESSAGES = (
    MessagePackage("simulation_interfaces", "2.1.0", "Apache-2.0", "the standard's services to steer simulators"),
)
ON_DEMAND = {"autoware": AUTOWARE_MESSAGES, "serve": SERVED_MESSAGES}
"""Packages that few need: those of the relay for Autoware and of ``--serve``, made when these start first."""
