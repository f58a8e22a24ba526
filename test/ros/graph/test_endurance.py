"""A short run of the endurance benchmark: what it watches, and that nothing but memory rises."""

import json
import subprocess
import sys

import pytest

pytestmark = [pytest.mark.graph, pytest.mark.slow]

NODES = {"supervisor", "fork server", "world", "camera", "lidar+radar", "gnss+imu", "annotator"}
FILES = {"/dev/shm", "temporary files"}
MAX_WARM_UP_MIB = 1100.0
"""The first minute of a graph is warm-up, which a run this short cannot leave out; processes keep up to 1 GiB of what
they have freed (``foundation.process_memory``)."""


def test_descriptors_threads_and_files_stay_flat_in_a_live_scene_and_over_many_scenes() -> None:
    command = [sys.executable, "-m", "tools.bench", "endurance", "--minutes", "1", "--scenes", "6"]
    result = subprocess.run([*command, "--json"], capture_output=True, text=True, timeout=600, check=False)
    assert result.returncode in (0, 1), result.stderr
    live, scenes = json.loads(result.stdout)["runs"]
    assert {trend["name"] for trend in live["trends"]} == NODES | FILES | {"subscriber"}
    assert {trend["name"] for trend in scenes["trends"]} == NODES | FILES | {"recorder"}
    assert live["samples"] >= 20
    assert scenes["samples"] == 6
    for trend in (*live["trends"], *scenes["trends"]):
        allowed = MAX_WARM_UP_MIB if trend["quantity"] == "memory_mib" else trend["max_rise"]
        assert trend["rise"] <= allowed, trend
