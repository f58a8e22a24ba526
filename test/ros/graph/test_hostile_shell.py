"""A graph runs in shells whose variables would keep it from working, and names those that it dropped."""

import subprocess
import sys
from pathlib import Path

import pytest
from commands import SCENE, Command, write_small
from module_trap import set_trap

from simbev_ros.foundation.installation.ros_release import profile_variable
from simbev_ros.recording.reader import SceneBag

pytestmark = [pytest.mark.graph, pytest.mark.slow]


def test_a_scene_is_recorded_whatever_the_shell_of_a_ros_user_has_set(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "old/numpy").mkdir(parents=True)
    (tmp_path / "old/numpy/__init__.py").write_text("raise ImportError('made for another Python')\n")
    dropped = {
        "RMW_IMPLEMENTATION": "rmw_none_cpp",
        "ROS_DISCOVERY_SERVER": "127.0.0.1:11811",
        "ROS_STATIC_PEERS": "not a host",
        "ROS_LOG_DIR": "/proc/none",
        profile_variable(): "/none.xml",
    }
    silent = {
        "PYTHONPATH": str(tmp_path / "old"),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF",
        "ROS_LOCALHOST_ONLY": "1",
        "RCUTILS_COLORIZED_OUTPUT": "yes",
        "RCUTILS_LOGGING_USE_STDOUT": "yes",
        "PROJ_DATA": "/none",
        "SUMO_HOME": "/none",
    }
    for name, value in (dropped | silent).items():
        monkeypatch.setenv(name, value)
    config = write_small(tmp_path, 0.5, without=("camera", "lidar", "radar"))
    code, output = Command("run", config, "--record", tmp_path / "out").finish()
    assert code == 0, output
    warned = [line.split("=")[0] for line in output.splitlines() if line.startswith("warning: ")]
    assert sorted(warned) == sorted(f"warning: {name}" for name in dropped)
    assert len(output.splitlines()) < 20
    with SceneBag(tmp_path / "out" / SCENE) as bag:
        assert bag.custom_data["complete"] == "true"


def test_no_process_of_a_graph_takes_modules_from_the_current_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    trap = set_trap(tmp_path)
    config = write_small(tmp_path, 0.5, without=("camera", "radar"))
    command = [
        Path(sys.executable).with_name("simbev"),
        "generate",
        config,
        "--out",
        tmp_path / "out",
        "--workers",
        "2",
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert not trap.exists(), trap.read_text()
