"""Running the graph as a user would: as a command in a process of its own."""

import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

SMALL = """
seed: 11
scenes: [{map: Blocks, train: 1}]
time: {warm_up_s: 1, duration_s: DURATION}
rig:
  sensors:
    - {type: camera, name: cam_front, pose: {x_m: 0.6, z_m: 1.6}, width_px: 96, height_px: 64, rate_hz: 10}
    - {type: lidar, name: lidar, pose: {z_m: 1.8}, channels: 8, columns: 128}
    - {type: gnss, name: gnss}
    - {type: imu, name: imu}
weather: {cloudiness: 20, precipitation: 0, sun_altitude_deg: 45, fog_density: 0}
traffic: {vehicles: 15, pedestrians: 15, spawn_radius_m: 150}
annotation: {bev: {rows: 100, columns: 100}}
"""


class Command:
    """A running ``simbev`` command in a session of its own."""

    def __init__(self, *arguments: object) -> None:
        environment = {**os.environ, "COLUMNS": "200"}
        environment.pop("ROS_DOMAIN_ID", None)
        self.process = subprocess.Popen(
            [sys.executable, "-m", "simbev_ros.cli.main", *map(str, arguments)],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env=environment,
            start_new_session=True,
        )

    def finish(self, timeout_s: float = 120) -> tuple[int, str]:
        """Exit code and output."""
        output, _ = self.process.communicate(timeout=timeout_s)
        return self.process.returncode, output

    def nodes(self) -> dict[str, int]:
        """Label of each node process (as in ``gnss+imu``) → pid."""
        found = {}
        for pid in children_of(self.process.pid):
            words = Path(f"/proc/{pid}/cmdline").read_text().split("\0")
            if "simbev_ros.nodes.main" in words:
                names = [
                    w.partition(":")[2]
                    for w in words[words.index("simbev_ros.nodes.main") + 1 : words.index("--ros-args")]
                ]
                found["+".join(names)] = pid
        return found

    def wait_for(self, condition: Callable[[], bool], timeout_s: float = 60) -> None:
        """Wait until a condition holds; fail if the command ends before."""
        end_s = time.monotonic() + timeout_s
        while not condition():
            assert self.process.poll() is None, self.process.stdout and self.process.stdout.read()
            assert time.monotonic() < end_s, "timed out"
            time.sleep(0.05)


def children_of(pid: int) -> list[int]:
    """Direct children of a process."""
    return [int(word) for word in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def middleware_files() -> set[str]:
    """Names of Fast DDS's files in shared memory."""
    return {path.name for path in Path("/dev/shm").iterdir() if "fastrtps" in path.name}


def node_processes() -> list[int]:
    """Pids of all node processes on this machine."""
    found = []
    for path in Path("/proc").iterdir():
        try:
            if path.name.isdecimal() and b"simbev_ros.nodes.main" in (path / "cmdline").read_bytes():
                found.append(int(path.name))
        except OSError:
            continue
    return found
