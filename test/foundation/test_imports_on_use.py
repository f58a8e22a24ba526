"""Modules that take long to load are only imported by the processes that need them."""

import json
import subprocess
import sys

import pytest

UNUSED = {
    "simbev_ros.dataset.plan": {"pyarrow", "rosbags", "simbev_ros.dataset.frame"},
    "simbev_ros.recording.reader": {"pyarrow"},
    "simbev_ros.production.play": {"pyarrow", "simbev_ros.dataset.frame", "simbev_ros.evaluation"},
    "simbev_ros.production.dataset": {
        *("scipy", "pyproj", "simbev_ros.production.scene_maker", "simbev_ros.simulation.world")
    },
    "simbev_ros.ros.nodes.lidar_node": {"moderngl", "libsumo", "scipy.interpolate", "simbev_ros.maps.builder"},
    "simbev_ros.ros.nodes.camera_node": {
        *("open3d", "libsumo", "scipy.interpolate", "simbev_ros.assets.regions.build")
    },
    "simbev_ros.ros.nodes.world_node": {"moderngl", "open3d", "simbev_ros.maps.builder"},
}
LOADING = """
import importlib, json, os, sys
import numpy, pydantic, rclpy  # once for all forks
for module in sys.argv[1:]:
    if os.fork() == 0:
        importlib.import_module(module)
        print(json.dumps([module, *sys.modules]), flush=True)
        os._exit(0)
    os.wait()
"""


def run(program: str, *arguments: str) -> str:
    command = [sys.executable, "-W", "ignore", "-c", program, *arguments]
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout


@pytest.fixture(scope="module")
def loaded() -> dict[str, set[str]]:
    """All that a process has loaded after it has imported one of the modules."""
    return {module: set(others) for module, *others in map(json.loads, run(LOADING, *UNUSED).splitlines())}


@pytest.mark.parametrize("module", UNUSED)
def test_importing_a_module_does_not_load_what_it_may_never_need(loaded: dict[str, set[str]], module: str) -> None:
    assert module in loaded[module] and UNUSED[module] & loaded[module] == set()


def test_the_command_line_loads_nothing_before_it_knows_the_verb() -> None:
    found = set(run("import sys, simbev_ros.cli.main; print(*sys.modules)").split())
    assert found & {"numpy", "rclpy", "pydantic", "simbev_ros.cli.run"} == set()
