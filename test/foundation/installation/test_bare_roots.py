"""The two commands of the README work on a machine that has nothing: no Python, no library, no certificates."""

import os
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from bare_root import BareRoot

MODULES = (
    "test/foundation/geometry/test_transforms.py",  # pure
    "tools/test/test_system_libraries.py",  # the closure, by this system's own database
    "test/simulation/raycast/test_ray_scene.py",
    "test/simulation/render/test_labels.py",  # OpenGL
    "test/ros/graph/test_control.py",  # processes of ROS
)

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(os.geteuid() != 0, reason="only root can change into another root"),
    pytest.mark.skipif(shutil.which("debootstrap") is None, reason="debootstrap is not installed"),
]


@pytest.fixture(params=["bookworm", "trixie", "noble"])
def root(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[BareRoot]:
    ubuntu = request.param == "noble"
    try:
        root = BareRoot(tmp_path / request.param, request.param, ubuntu=ubuntu)
    except subprocess.CalledProcessError as error:
        if not ubuntu:
            raise
        pytest.skip(f"no mirror of Ubuntu answers: {(error.stdout + error.stderr)[-200:]}")
    yield root
    root.remove()


def test_both_commands_work_and_need_no_network_the_second_time(root: BareRoot) -> None:
    demo = root.run("./simbev demo --out /tmp/demo")
    assert demo.returncode == 0, demo.stdout + demo.stderr
    assert (root.folder / "tmp/demo/Blocks-0000.png").stat().st_size > 100_000
    set_up = [line for line in demo.stderr.splitlines() if line.startswith("simbev: ")]
    assert set_up == ["simbev: system packages", "simbev: Python packages"]

    again = root.run("./simbev demo --out /tmp/again && ./simbev doctor", offline=True)
    assert again.returncode == 0, again.stdout + again.stderr

    tests = root.run(f"./simbev test {MODULES[0]}")
    assert tests.returncode == 0, tests.stdout + tests.stderr
    tests = root.run(f"./simbev test {' '.join(MODULES[1:])}", offline=True)
    assert tests.returncode == 0, tests.stdout + tests.stderr
    assert " failed" not in tests.stdout and " passed" in tests.stdout
