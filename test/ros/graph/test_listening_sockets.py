"""A graph listens on the loopback interface alone, unless it is opened to the network."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import psutil
import pytest

from simbev_ros.config.paths import shipped_config_dir
from simbev_ros.foundation.installation.ros_release import profile_variable
from simbev_ros.ros.graph.environment import graph_environment
from simbev_ros.ros.graph.exposure import Exposure

pytestmark = pytest.mark.graph

NODE = "import rclpy, sys; rclpy.init(); node = rclpy.create_node('some'); print('up', flush=True); sys.stdin.read()"
DISCOVERY_PORT = 7400
"""First port of the domain 0 (RTPS 2.2, 9.6.1.1); a domain has 250 of them."""


def listening(domain: int, *, network: bool, folder: Path | None = None) -> set[str]:
    """Addresses on which the sockets of a node that starts in a folder have the ports of a domain."""
    names = (profile_variable(), "ROS_AUTOMATIC_DISCOVERY_RANGE", "SKIP_DEFAULT_XML_FILE")
    inherited = {name: value for name, value in os.environ.items() if name not in names}
    with pytest.MonkeyPatch.context() as patch:
        for name in names:
            patch.delenv(name, raising=False)
        environment = graph_environment(domain, Exposure(network=network))
    command = [sys.executable, "-c", NODE]
    streams = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    with subprocess.Popen(command, env={**inherited, **environment}, cwd=folder, text=True, **streams) as process:
        assert process.stdout is not None and process.stdout.readline() == "up\n"
        first = DISCOVERY_PORT + 250 * domain
        sockets = psutil.Process(process.pid).net_connections("inet")
        process.communicate("")
    return {each.laddr.ip for each in sockets if first <= each.laddr.port < first + 250}


def test_nobody_beyond_the_loopback_interface_reaches_a_graph_unless_it_is_opened() -> None:
    assert listening(87, network=False) == {"127.0.0.1"}
    assert listening(86, network=True) == {"0.0.0.0"}


def test_a_profile_in_the_current_folder_opens_nothing(tmp_path: Path) -> None:
    for name in ("DEFAULT_FASTRTPS_PROFILES.xml", "DEFAULT_FASTDDS_PROFILES.xml"):
        shutil.copy(shipped_config_dir() / "fastdds_network.xml", tmp_path / name)
    assert listening(85, network=False, folder=tmp_path) == {"127.0.0.1"}
