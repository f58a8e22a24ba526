"""A command in a process with low limits works, or says in one line which limit to raise; nothing crashes."""

import resource
import subprocess
import sys
from pathlib import Path

import pytest
from made_up_scene import made_up_scene

CONFIG = "scenes: [{map: Blocks, train: 1}]\nrig: {sensors: [{type: imu, name: imu}]}\n"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a configuration and a dataset."""
    folder = tmp_path_factory.mktemp("limited")
    (folder / "my.yaml").write_text(CONFIG)
    made_up_scene(folder / "set/scenes/train/Blocks-0000", ticks=1)
    return folder


@pytest.mark.parametrize(
    ("kind", "value", "command", "code", "line"),
    [
        # Where SciPy's libraries end the process by SIGSEGV, and where OpenBLAS waits for ever.
        (
            "AS",
            600000 << 10,
            "scene my.yaml",
            2,
            "error: ulimit -v allows 0.572 GiB of address space, and simbev scene",
        ),
        (
            "AS",
            300000 << 10,
            "info set",
            2,
            "error: ulimit -v allows 0.286 GiB of address space, and simbev info needs",
        ),
        ("AS", 1500000 << 10, "run my.yaml", 2, "error: ulimit -v allows 1.43 GiB of address space, and a graph needs"),
        ("AS", 60000 << 10, "run --help", 1, "error: memory ran out: ulimit -v allows 0.0572 GiB of address space"),
        ("NOFILE", 20, "generate my.yaml --out out", 2, "error: ulimit -n allows 20 open files, and a graph needs 64"),
    ],
)
def test_a_low_limit_ends_in_one_line(folder: Path, kind: str, value: int, command: str, code: int, line: str) -> None:
    done = _limited(folder, kind, value, *command.split(" "))
    assert (done.returncode, len(done.stdout.splitlines())) == (code, 1), done.stdout
    assert done.stdout.startswith(line)
    assert not (folder / "out").exists()


@pytest.mark.parametrize(
    ("mount", "line"),
    [
        ("-t tmpfs -o size=4k tmpfs /dev/shm", "error: /dev/shm: is full; processes of a graph share memory there"),
        ("-t tmpfs -o ro tmpfs /dev/shm", "error: /dev/shm: cannot be written to; processes of a graph share memory"),
        ("-t tmpfs tmpfs /proc", "error: /proc: is not mounted; a graph follows its processes there; mount -t proc"),
    ],
)
def test_a_machine_without_what_a_graph_needs_is_refused(folder: Path, mount: str, line: str) -> None:
    alone = ["unshare", "--mount", "sh", "-c", f"mount {mount} && exec $0 -m simbev_ros.cli.main run my.yaml"]
    done = subprocess.run([*alone, sys.executable], cwd=folder, capture_output=True, text=True, check=False)
    if "unshare: " in done.stderr or "mount: " in done.stderr:
        pytest.skip("nothing can be mounted here")
    assert (done.returncode, done.stdout) == (2, "") and done.stderr.startswith(line)


def test_a_dataset_is_read_with_few_files_open(folder: Path) -> None:
    done = _limited(folder, "NOFILE", 20, "info", "set")
    assert done.returncode == 0 and "train/Blocks-0000" in done.stdout


def _limited(folder: Path, kind: str, value: int, *words: str) -> subprocess.CompletedProcess[str]:
    limit = getattr(resource, f"RLIMIT_{kind}")
    return subprocess.run(
        [sys.executable, "-m", "simbev_ros.cli.main", *words],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
        preexec_fn=lambda: resource.setrlimit(limit, (value, value)),
    )
