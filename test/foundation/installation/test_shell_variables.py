"""Variables of users' shells with values that a graph cannot work with are dropped, with the reason; others stay."""

import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from simbev_ros.config.paths import shipped_config_dir
from simbev_ros.foundation.installation import shell_variables
from simbev_ros.foundation.installation.ros_release import profile_variable
from simbev_ros.foundation.installation.shell_variables import settle_shell

PROFILE = profile_variable()


@pytest.fixture(autouse=True)
def one_middleware(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shell_variables, "_middlewares", lambda: ["rmw_fastrtps_cpp"])


@pytest.mark.parametrize(
    ("name", "value", "reason"),
    [
        ("RMW_IMPLEMENTATION", "rmw_cyclonedds_cpp", "this ROS has only rmw_fastrtps_cpp"),
        ("RMW_IMPLEMENTATION", "rmw_zenoh_cpp", "those with Zenoh do not"),
        (PROFILE, "/none.xml", "no file with profiles"),
        (PROFILE, __file__, "no file with profiles"),
        (PROFILE, str(shipped_config_dir() / "cyclonedds.xml"), "no file with profiles"),
        ("ROS_STATIC_PEERS", "127.0.0.1;not a host", "a host that cannot be found"),
        ("ROS_DISCOVERY_SERVER", "127.0.0.1:11811", "without a discovery server"),
        ("ROS_LOG_DIR", "/proc/none", "cannot be written to"),
        ("ROS_LOG_DIR", __file__, "cannot be written to"),
        ("ROS_HOME", "/proc/none", "cannot be written to"),
    ],
)
def test_what_a_graph_cannot_work_with_is_dropped_with_a_reason(name: str, value: str, reason: str) -> None:
    environment = {name: value, "HOME": "/root"}
    (found,) = settle_shell(environment)
    assert environment == {"HOME": "/root"}
    assert found.was_dropped and reason in str(found) and str(found).startswith(f"{name}={value[:20]}")


@pytest.mark.parametrize(("name", "value"), [("ROS_LOCALHOST_ONLY", "1"), ("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF")])
def test_the_range_of_discovery_is_that_of_the_command_without_a_warning(name: str, value: str) -> None:
    environment = {name: value}
    (found,) = settle_shell(environment)
    assert not environment and not found.was_dropped and "--network" in found.effect


def test_good_values_stay_and_only_those_that_matter_are_named(tmp_path: Path) -> None:
    mine = tmp_path / "mine.xml"
    mine.write_text("<dds><profiles/></dds>")
    environment = {
        "RMW_IMPLEMENTATION": "rmw_fastrtps_cpp",
        PROFILE: str(mine),
        "ROS_STATIC_PEERS": "127.0.0.1",
        "ROS_LOG_DIR": str(tmp_path / "log"),
        "LD_LIBRARY_PATH": f"/opt/mine/lib:{sys.prefix}/lib",
        "CYCLONEDDS_URI": "file:///mine",
    }
    before = dict(environment)
    found = {each.name: each for each in settle_shell(environment)}
    assert environment == before
    assert set(found) == {PROFILE, "LD_LIBRARY_PATH"}
    assert found["LD_LIBRARY_PATH"].value == "/opt/mine/lib"
    assert not any(each.was_dropped for each in found.values())


def test_what_simbev_and_its_wheels_set_is_not_named() -> None:
    profile = shipped_config_dir() / "fastdds.xml"
    assert not settle_shell({PROFILE: str(profile), "LD_LIBRARY_PATH": f"{sys.prefix}/lib"})


@pytest.mark.parametrize(("jazzy", "read", "other"), [(True, "FASTRTPS", "FASTDDS"), (False, "FASTDDS", "FASTRTPS")])
def test_the_profile_is_looked_at_under_the_name_that_the_release_reads(
    jazzy: bool, read: str, other: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(shell_variables, "is_jazzy", lambda: jazzy)
    (tmp_path / "mine.xml").write_text("<dds><profiles/></dds>")
    (used,) = settle_shell({f"{read}_DEFAULT_PROFILES_FILE": str(tmp_path / "mine.xml")})
    (unused,) = settle_shell({f"{other}_DEFAULT_PROFILES_FILE": str(tmp_path / "mine.xml")})
    assert "large images are lost" in used.effect and not used.was_dropped
    assert f"{read}_DEFAULT_PROFILES_FILE" in unused.effect and unused.was_dropped is not jazzy


@pytest.mark.skipif(find_spec("rclpy") is None, reason="there is no ROS")
@pytest.mark.parametrize(
    "command",
    [
        ("-m", "simbev_ros.ros.nodes.main", "none"),
        (str(Path(sys.executable).with_name("simbev_node")), "none"),
        ("-m", "simbev_ros.baselines.node", "lidar", "/none.onnx"),
    ],
    ids=["module", "program", "baseline"],
)
def test_a_node_started_by_itself_loads_ros_although_its_middleware_is_missing(command: tuple[str, ...]) -> None:
    environment = {**os.environ, "RMW_IMPLEMENTATION": "rmw_none_cpp"}
    done = subprocess.run(
        [sys.executable, *command], env=environment, capture_output=True, text=True, check=False, timeout=60
    )
    warning, error = done.stderr.splitlines()
    assert done.returncode == 2, done.stderr  # that of the wrong argument, which is read with ROS loaded
    assert warning.startswith("warning: RMW_IMPLEMENTATION=rmw_none_cpp: dropped: this ROS has only ")
    assert "unset the variable" in warning
    assert error.startswith("error: ") and "none" in error


def test_a_program_that_imports_nodes_keeps_its_shell() -> None:
    program = "import os; import simbev_ros.ros.nodes, simbev_ros.baselines; print(os.environ['RMW_IMPLEMENTATION'])"
    environment = {**os.environ, "RMW_IMPLEMENTATION": "rmw_none_cpp"}
    done = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("rmw_none_cpp\n", "")
