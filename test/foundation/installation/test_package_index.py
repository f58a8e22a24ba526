"""ROS's tools find the package in an environment that ./simbev has set up: pip leaves its other files out."""

import os
import re
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
