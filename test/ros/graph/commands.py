"""Runs the graph as a user does, by a ``simbev`` command in a process of its own."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import psutil
from marked_processes import marked_processes
from ros_domain import DOMAIN
from waiting import PATIENCE_S, wait_until

from simbev_ros.recording.digest import topic_digests
from simbev_ros.recording.reader import SceneBag
from simbev_ros.ros.graph.shared_memory import held_files, middleware_files, remove_orphans

SMALL = """
seed: 11
scenes: [{map: Blocks, train: 1}]
time: {warm_up_s: 1, duration_s: DURATION}
rig:
  sensors:
    - {type: camera, name: cam_front, pose: {x_m: 0.6, z_m: 1.6}, width_px: 96, height_px: 64, rate_hz: 10}
    - {type: lidar, name: lidar, pose: {z_m: 1.8}, channels: 8, columns: 128}
    - {type: radar, name: radar_front, pose: {x_m: 2.4, z_m: 0.6}, points_per_second: 4000, micro_doppler: true}
    - {type: gnss, name: gnss}
    - {type: imu, name: imu}
    - {type: imu, name: imu_fast, rate_hz: 100}
weather: {cloudiness: 20, precipitation: 0, sun_altitude_deg: 45, fog_density: 0}
traffic: {vehicles: 15, pedestrians: 15, spawn_radius_m: 150}
annotation:
  bev: {rows: 100, columns: 100}
  occupancy: {half_side_m: 20, voxel_m: 1, rate_hz: 10}
  vector_map: {rate_hz: 5}
"""


def write_small(
    folder: Path, duration_s: float = 0.5, more: str = "", name: str = "small.yaml", without: Collection[str] = ()
) -> Path:
    """Write a small configuration of a given duration, with further text appended.

    Kinds of sensors that a test does not need can be left out: their processes take the longest to start.
    """
    lines = SMALL.replace("DURATION", f"{duration_s:g}").splitlines(keepends=True)
    path = folder / name
    path.write_text("".join(line for line in lines if not any(f"type: {kind}," in line for kind in without)) + more)
    return path


SCENE = Path("scenes/train/Blocks-0000")
"""Path of the first scene in its dataset."""


_PRETEND_CORES = """
import os
os.sched_getaffinity = lambda _: set(range({}))
from simbev_ros.cli.main import main
main()
"""


class Command:
    """A ``simbev`` command that runs in a session of its own, on a machine with a given number of cores."""

    def __init__(self, *arguments: object, cores: int = 2) -> None:
        self.environment = {**os.environ, "COLUMNS": "200", "ROS_DOMAIN_ID": str(DOMAIN)}
        self.process = subprocess.Popen(
            [sys.executable, "-c", _PRETEND_CORES.format(cores), *map(str, arguments)],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env=self.environment,
            start_new_session=True,
        )

    def finish(self, timeout_s: float = PATIENCE_S) -> tuple[int, str]:
        """Wait for the end of the command; return exit code and output."""
        output, _ = self.process.communicate(timeout=timeout_s)
        return self.process.returncode, output

    def close(self) -> None:
        """End the command if it still runs."""
        self.process.terminate()
        try:
            self.process.wait(20)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        if self.process.stdout is not None:
            self.process.stdout.close()

    def nodes(self) -> dict[str, int]:
        """Pid of each node process, by label (such as ``gnss+imu``)."""
        found = {}
        for process in psutil.Process(self.process.pid).children(recursive=True):
            with suppress(psutil.NoSuchProcess):
                words = " ".join(process.cmdline()).split()
                if words[:1] == ["simbev_ros.ros.nodes.main"]:
                    names = [word.partition(":")[2].rpartition("/")[2] for word in words[1 : words.index("--ros-args")]]
                    found["+".join(names)] = process.pid
        return found

    def wait_for(
        self, condition: Callable[[], object], wait: Callable[[Callable[[], object]], None] = wait_until
    ) -> None:
        """Wait until a condition holds; fail if the command ends earlier."""

        def holds() -> object:
            has_ended, is_met = self.process.poll() is not None, condition()
            assert is_met or not has_ended, self.process.stdout and self.process.stdout.read()
            return is_met

        wait(holds)


Simbev = Callable[..., Command]
"""Starts a command, as ``Command`` does."""
Config = Callable[..., Path]
"""Writes a small configuration, as ``write_small`` does."""
Find = Callable[[str], list[int]]
"""Finds processes by a part of their command line."""


def digests(bag: Path) -> dict[str, str]:
    """Digest of each topic of a bag but typed messages, which say the same as tables."""
    with SceneBag(bag) as opened:
        return {name: digest for name, digest in topic_digests(opened).items() if not name.endswith("/typed")}


def record(simbev: Callable[..., Command], config: Path, dataset: Path) -> Path:
    """Record a configuration's scenes; return the bag of the first one."""
    code, output = simbev("run", config, "--record", dataset).finish()
    assert code == 0, output
    return dataset / SCENE


@contextmanager
def leaving_nothing() -> Iterator[None]:
    """Check that in the end no node process runs, and that there is no new file of the middleware in /dev/shm.

    The files do not say whose they are, so they are not checked while other graphs run on the machine. What is left is
    removed, so that the next test does not fail as well.
    """
    before = {path.name for path in middleware_files()}
    yield
    with suppress(AssertionError):
        wait_until(lambda: not node_processes() and (not orphaned_files() - before or not is_alone()), 60)
    processes, files = node_processes(), orphaned_files() - before
    left = [f"{' '.join(words).strip()} (process {pid})" for pid, words in processes.items()]
    if files and is_alone():
        left += sorted(files)
    for pid in processes:
        with suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)
    if left:
        wait_until(lambda: not node_processes())
        remove_orphans({path for path in middleware_files() if path.name not in before})
    assert not left


def orphaned_files() -> set[str]:
    """Names of Fast DDS's shared-memory files that no process has mapped."""
    files = set(middleware_files())
    held = held_files(psutil.pids())
    return {path.name for path in files - held}


def is_alone() -> bool:
    """Whether no other test run or graph on this machine uses the middleware, so that its files are of these tests."""
    own = psutil.Process()
    related = {own.pid, *(each.pid for each in (*own.parents(), *own.children(recursive=True)))}
    for process in psutil.process_iter(["cmdline"]):
        words = " ".join(process.info["cmdline"] or ())
        if process.pid not in related and ("simbev_ros" in words or "pytest" in words):
            return False
    return True


def remove_leftovers(before: set[Path]) -> None:
    """Remove files of the middleware that killed commands have left since ``before``, as their processes end."""
    wait_until(
        lambda: not set(middleware_files()) - before or not is_alone(),
        meanwhile=lambda: remove_orphans(set(middleware_files()) - before),
    )


def node_processes() -> dict[int, list[str]]:
    """All node processes in the tests' domain: their command lines by pid."""
    found = {}
    for pid in marked_processes("simbev_ros.ros.nodes.main", f"ROS_DOMAIN_ID={DOMAIN}".encode()):
        with suppress(psutil.NoSuchProcess):
            found[pid] = psutil.Process(pid).cmdline()
    return found
