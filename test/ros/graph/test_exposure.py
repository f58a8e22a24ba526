"""Who can take part in a graph: keys are made by SROS 2, and without it there is one message."""

import stat
from importlib.metadata import distributions
from pathlib import Path

import pytest
from commands import SMALL, Command

from simbev_ros.foundation.errors import InputError
from simbev_ros.ros.graph.exposure import LOCAL, Exposure

pytestmark = pytest.mark.graph

MADE_UP_ROS2 = """#!/bin/sh
[ "$1" = security ] || exit 9
case "$2" in
create_keystore) mkdir -p "$3/enclaves" ;;
create_enclave) mkdir -p "$3/enclaves$4" && echo key > "$3/enclaves$4/key.pem" ;;
esac
"""


@pytest.fixture
def ros2(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A command that makes the folders of keys, as sros2 does, in front of all others."""
    command = tmp_path / "bin" / "ros2"
    command.parent.mkdir()
    command.write_text(MADE_UP_ROS2)
    command.chmod(command.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setenv("PATH", f"{command.parent}:/usr/bin:/bin")
    return command


@pytest.mark.usefixtures("ros2")
def test_keys_are_made_in_the_graphs_folder_and_enforced(tmp_path: Path) -> None:
    variables = Exposure(security=True).security_environment(tmp_path)
    assert (tmp_path / "keystore/enclaves/simbev_ros/key.pem").is_file()
    assert variables == {
        "ROS_SECURITY_KEYSTORE": str(tmp_path / "keystore"),
        "ROS_SECURITY_ENABLE": "true",
        "ROS_SECURITY_STRATEGY": "Enforce",
        "ROS_SECURITY_ENCLAVE_OVERRIDE": "/simbev_ros",
    }
    assert LOCAL.security_environment(tmp_path) == {}


def test_a_command_that_fails_is_quoted(ros2: Path, tmp_path: Path) -> None:
    ros2.write_text("#!/bin/sh\necho 'invalid choice: security' >&2\nexit 2\n")
    with pytest.raises(InputError, match="create_keystore failed: invalid choice: security; a secure graph needs SROS"):
        Exposure(security=True).security_environment(tmp_path)


def test_without_sros_2_the_message_says_what_to_do(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "/usr/bin:/bin")
    with pytest.raises(InputError, match=r"^there is no command ros2; a secure graph needs SROS 2: source"):
        Exposure(security=True).security_environment(tmp_path)


@pytest.mark.slow
@pytest.mark.usefixtures("ros2")
def test_a_middleware_without_security_ends_the_run_with_one_message(tmp_path: Path) -> None:
    if not list(distributions(name="ros-rmw-fastrtps-cpp")):
        pytest.skip("the middleware is not that of the wheels")
    (tmp_path / "a.yaml").write_text(SMALL.replace("DURATION", "0.5"))
    code, output = Command("run", tmp_path / "a.yaml", "--security").finish()
    assert code == 2 and "Traceback" not in output
    assert "Fast DDS version doesn't have the security libraries; a secure graph needs SROS 2" in output
