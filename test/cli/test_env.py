"""``simbev env`` prints what a shell has to know of graphs and of this installation."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from simbev_ros.config.paths import shipped_config_dir
from simbev_ros.foundation.installation.ros_release import profile_variable
from simbev_ros.ros.graph.environment import subscriber_environment
from simbev_ros.ros.graph.exposure import Exposure

PROFILE = profile_variable()


@pytest.fixture(autouse=True)
def nothing_is_set(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in (PROFILE, "CYCLONEDDS_URI", "ROS_AUTOMATIC_DISCOVERY_RANGE", "AMENT_PREFIX_PATH", "ROS_DOMAIN_ID"):
        monkeypatch.delenv(name, raising=False)


def exported(script: str) -> dict[str, str]:
    """Variables after a POSIX shell has run a script; ``env`` is called by its path, as the script may change PATH."""
    command = [sys.executable, "-c", "import os; print('\\0'.join(f'{k}={v}' for k, v in os.environ.items()))"]
    shell = ["sh", "-c", script + '\nexec "$@"', "sh", *command]
    output = subprocess.run(shell, capture_output=True, text=True, check=True).stdout.rstrip("\n")
    return dict(word.split("=", 1) for word in output.split("\0"))


def test_a_shell_takes_profile_domain_and_search_paths(simbev: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("AMENT_PREFIX_PATH", "/some where/else")
    variables = exported(simbev("env", "--domain", "7").out)
    assert variables["ROS_DOMAIN_ID"] == "7"
    assert variables[PROFILE] == str(shipped_config_dir() / "fastdds.xml")
    assert variables["CYCLONEDDS_URI"] == (shipped_config_dir() / "cyclonedds.xml").as_uri()
    assert variables["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "LOCALHOST"
    assert variables["AMENT_PREFIX_PATH"] == f"{sys.prefix}:/some where/else"
    assert variables["PATH"].split(os.pathsep)[0] == str(Path(sys.prefix) / "bin")


def test_sourced_again_it_changes_nothing(simbev: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    first = simbev("env").out
    for name, value in exported(first).items():
        monkeypatch.setenv(name, value)
    assert simbev("env").out == first


def test_a_graph_for_the_network_does_not_take_the_profile_of_a_local_one_for_the_users_choice(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    network = Exposure(network=True)
    for name, value in subscriber_environment().items():
        monkeypatch.setenv(name, value)
    assert subscriber_environment(network)[PROFILE] == str(shipped_config_dir() / "fastdds_network.xml")
    assert subscriber_environment(network)["CYCLONEDDS_URI"] == ""
    assert subscriber_environment(network)["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "SUBNET"
    monkeypatch.setenv(PROFILE, "/my/profile.xml")
    monkeypatch.setenv("CYCLONEDDS_URI", "file:///my/cyclonedds.xml")
    assert subscriber_environment(network)["CYCLONEDDS_URI"] == "file:///my/cyclonedds.xml"
    assert subscriber_environment(network)[PROFILE] == "/my/profile.xml"


def test_what_is_dropped_is_said_apart_from_what_the_shell_takes(simbev: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_STATIC_PEERS", "not a host")
    answer = simbev("env")
    assert "warning: ROS_STATIC_PEERS=not a host: dropped: " in answer.err
    assert "ROS_STATIC_PEERS" not in exported(answer.out) and "warning" not in answer.out


@pytest.mark.parametrize("value", ["-1", "233", "x"])
def test_a_number_that_is_no_domain_is_refused(simbev: Any, value: str) -> None:
    assert simbev("env", "--domain", value).code == 2
