"""Who can take part in a graph: this host or the network, all participants or only those with keys (SROS 2)."""

import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

from simbev_ros.config.paths import shipped_config_dir
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.installation.ros_release import profile_variable

ENCLAVE = "/simbev_ros"
"""Enclave of all nodes of a graph, and of those that shall take part."""

NEEDS_SROS = "a secure graph needs SROS 2: source a ROS 2 Jazzy that has ros-jazzy-sros2 (ROS from wheels has not)"


@dataclass(frozen=True, slots=True)
class Exposure:
    """Who can take part in a graph.

    Attributes:
        network: Nodes on other hosts can; otherwise no socket listens beyond the loopback interface.
        security: Only nodes with the graph's keys can, and messages are encrypted.
    """

    network: bool = False
    security: bool = False

    @property
    def variables(self) -> dict[str, str]:
        """Environment variables for the graph and for those that take part; empty: Cyclone DDS's own settings."""
        folder = shipped_config_dir()
        return {
            profile_variable(): str(folder / ("fastdds_network.xml" if self.network else "fastdds.xml")),
            "SKIP_DEFAULT_XML_FILE": "1",  # of Fast DDS in the current folder, which would replace these settings
            "CYCLONEDDS_URI": "" if self.network else (folder / "cyclonedds.xml").as_uri(),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET" if self.network else "LOCALHOST",
        }

    def security_environment(self, folder: Path) -> dict[str, str]:
        """Make keys, if they are wanted; return the variables with which nodes use them.

        Args:
            folder: Folder for the keys, readable for this user only.

        Raises:
            InputError: SROS 2 is missing, or cannot make keys.
        """
        if not self.security:
            return {}
        ros2, keystore = shutil.which("ros2"), folder / "keystore"
        if ros2 is None:
            raise InputError(f"there is no command ros2; {NEEDS_SROS}")
        for words in (["create_keystore", str(keystore)], ["create_enclave", str(keystore), ENCLAVE]):
            done = subprocess.run(
                [ros2, "security", *words], stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False
            )
            if done.returncode:
                last = (done.stderr.strip() or done.stdout.strip() or "no output").splitlines()[-1]
                raise InputError(f"ros2 security {words[0]} failed: {last}; {NEEDS_SROS}")
        return {
            "ROS_SECURITY_KEYSTORE": str(keystore),
            "ROS_SECURITY_ENABLE": "true",
            "ROS_SECURITY_STRATEGY": "Enforce",
            "ROS_SECURITY_ENCLAVE_OVERRIDE": ENCLAVE,
        }


LOCAL = Exposure()
"""Nodes on this host can take part."""
