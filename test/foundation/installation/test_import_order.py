"""Packages on PYTHONPATH, which ROS users' shells set, do not hide those of the environment."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from module_trap import set_trap

from simbev_ros.foundation.installation.import_order import module_command

ROOT = Path(__file__).parents[3]


@pytest.fixture
def workspace(tmp_path: Path) -> Path:
    """A folder with a NumPy of another Python, and with messages and a program of the user's own."""
    (tmp_path / "numpy").mkdir()
    (tmp_path / "numpy/__init__.py").write_text("raise ImportError('made for another Python')\n")
    (tmp_path / "my_msgs.py").write_text("NAME = 'mine'\n")
    (tmp_path / "my_node.py").write_text(
        "import sys, my_msgs, numpy; print(my_msgs.NAME, numpy.__version__, *sys.argv[1:])\n"
    )
    return tmp_path


def output(*command: str, path: str) -> str:
    environment = {**os.environ, "PYTHONPATH": path}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_a_module_gets_our_packages_and_still_finds_those_of_a_workspace(workspace: Path) -> None:
    command = module_command("my_node", "--option")
    assert output(*command, path=str(workspace)).split() == ["mine", np.__version__, "--option"]


def test_our_packages_stay_first_where_pythonpath_names_their_folder_too(workspace: Path) -> None:
    path = os.pathsep.join([str(workspace), str(Path(np.__file__).parents[1]), ""])
    assert output(*module_command("my_node"), path=path).split() == ["mine", np.__version__]


def test_a_verb_works_with_another_numpy_on_pythonpath(workspace: Path) -> None:
    drawn = output(sys.executable, "-m", "simbev_ros.cli.main", "scene", "demo", "--count", "1", path=str(workspace))
    assert drawn.startswith("1 scene: ")


@pytest.fixture
def trap(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return set_trap(tmp_path)


def test_no_module_of_the_current_folder_runs(trap: Path) -> None:
    command = Path(sys.executable).with_name("simbev")
    subprocess.run([command, "scene", "demo", "--count", "1"], capture_output=True, check=True)
    subprocess.run(module_command("simbev_ros.cli.main", "--version"), capture_output=True, check=True)
    assert not trap.exists(), trap.read_text()
    subprocess.run([sys.executable, "-c", "import platform"], check=True)
    assert trap.read_text() == "platform "


def test_the_script_takes_what_breaks_python_from_the_environment_and_puts_own_libraries_first(tmp_path: Path) -> None:
    script, python = tmp_path / "simbev", tmp_path / ".venv/bin/python"
    script.write_text((ROOT / "simbev").read_text().replace('\nensure_ready "$extra"\n', "\n"))
    python.parent.mkdir(parents=True)
    python.write_text('#!/bin/sh\nenv\necho "$@"\n')
    for file in (script, python):
        file.chmod(0o755)
    (tmp_path / ".venv/lib/python3.12/site-packages/ros_rcl.libs").mkdir(parents=True)
    broken = {"PYTHONHOME": "/none", "PYTHONHASHSEED": "x", "PYTHONWARNINGS": "error", "PYTHONINSPECT": "1"}
    environment = {"PATH": os.environ["PATH"], "PYTHONPATH": ":/mine:.", "LD_LIBRARY_PATH": "/lib/mine", **broken}
    done = subprocess.run([script, "info"], env=environment, capture_output=True, text=True, check=True)
    lines = done.stdout.splitlines()
    assert lines[-1] == "-m simbev_ros.cli.main info"
    assert "PYTHONPATH=/mine:" not in lines and "PYTHONPATH=/mine" in lines and "PYTHONSAFEPATH=1" in lines
    libraries = tmp_path / ".venv/lib"
    own = f"{libraries}:{libraries}/python3.12/site-packages/ros_rcl.libs"
    assert f"LD_LIBRARY_PATH={own}:/lib/mine" in lines and "_ROS_WHEELS_BOOTSTRAP_COMPLETE=1" in lines
    assert not any(line.startswith(f"{name}=") for name in broken for line in lines)
