"""An environment that ./simbev has set up: ROS's tools find the package, whose other files pip leaves out."""

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest
from ament_index_python.packages import get_package_prefix, get_package_share_directory

REPOSITORY = Path(__file__).parents[3]


def test_the_set_up_registers_the_package_with_its_files_and_programs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    function = re.search(
        r"^register_package\(\) \{.*?^\}$", (REPOSITORY / "simbev").read_text(), re.DOTALL | re.MULTILINE
    )
    assert function is not None
    venv = tmp_path / "an environment"
    (venv / "bin").mkdir(parents=True)
    for name in ("simbev", "simbev_node"):
        (venv / "bin" / name).write_text("#!/bin/sh\n")
        (venv / "bin" / name).chmod(0o755)
    script = f"set -eu\nvenv=$1 here=$2\n{function[0]}\nregister_package\nregister_package\n"
    subprocess.run(["sh", "-c", script, "sh", venv, REPOSITORY], check=True)
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(venv))
    assert get_package_prefix("simbev_ros") == str(venv)
    share = Path(get_package_share_directory("simbev_ros"))
    assert (share / "package.xml").samefile(REPOSITORY / "package.xml")
    assert (share / "config" / "rviz" / "simbev.rviz").is_file()
    launched = {name for _, _, names in os.walk(share) for name in names if name.endswith(".launch.py")}
    assert launched == {"play.launch.py", "simbev.launch.py", "view.launch.py"}, "as ros2 launch looks for them"
    assert {path.name for path in (venv / "lib" / "simbev_ros").iterdir() if path.stat().st_mode & 0o100} == {
        "simbev", "simbev_node"
    }  # fmt: skip


def test_the_set_up_says_what_is_ready_and_what_is_next(tmp_path: Path) -> None:
    shutil.copy(REPOSITORY / "simbev", tmp_path)
    for name in ("simbev_ros", "exporters", "interfaces", "setup.py", "package.xml"):
        (tmp_path / name).symlink_to(REPOSITORY / name)
    wanted = re.search(r"^ +wanted=.*$", (REPOSITORY / "simbev").read_text(), re.MULTILINE)
    assert wanted is not None
    (tmp_path / ".venv").mkdir()
    script = f'here=$1\n{wanted[0]}\nprintf "%s\\n" "$wanted" >"$here/.venv/.ready-sim,wheels,view"'
    subprocess.run(["sh", "-c", script, "sh", tmp_path], check=True)
    own = {name: value for name, value in os.environ.items() if name != "ROS_DISTRO"}
    command = [tmp_path / "simbev", "setup", "view"]
    done = subprocess.run(command, env=own, capture_output=True, text=True, check=True)
    there = f"simbev: sim, wheels, view ready in {tmp_path}/.venv"
    assert done.stderr == f"{there}; next: {tmp_path}/simbev demo, or {tmp_path}/simbev --help\n"
