"""Commands on a cluster of two nodes: results and bytes are those of this machine, whatever dies or is interrupted."""

import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from made_up_scene import made_up_scene
from marked_processes import marked_processes
from waiting import wait_until

from simbev_ros.dataset.index import update_index
from simbev_ros.recording.layout import scenes_of

pytest.importorskip("ray", reason="Ray is not installed: pip install -e .[cluster]")

from ray_nodes import RayNodes

pytestmark = pytest.mark.slow
SCENES, TICKS = 8, 60
EXPORTS = ("simbev", "nuscenes")
_MARK, _TIMEOUT_S = ("SIMBEV_TEST_RAY", f"work {os.getpid()}"), 120.0


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("work") / "set"
    for number in range(SCENES):
        made_up_scene(folder / f"scenes/train/Blocks-{number:04d}", number=number, ticks=TICKS)
    update_index(folder, scenes_of(folder))
    return folder


@pytest.fixture(scope="module")
def nodes() -> Iterator[RayNodes]:
    """Two nodes with two CPUs each; no process of theirs may be left."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(*_MARK)
        cluster = RayNodes(2)
        yield cluster
        cluster.close()
    wait_until(lambda: not tasks("ray::"))


def tasks(name: str = "ray::_run") -> list[int]:
    """Processes of the nodes that do a task."""
    return marked_processes(name, "=".join(_MARK).encode())


def start(*words: object) -> subprocess.Popen[str]:
    """Start a command in a session of its own."""
    command = [sys.executable, "-m", "simbev_ros.cli.main", *map(str, words)]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    return subprocess.Popen(command, text=True, start_new_session=True, **pipes)


def finish(process: subprocess.Popen[str]) -> tuple[int, str, str]:
    """Exit code and output of a command."""
    out, err = process.communicate(timeout=_TIMEOUT_S)
    return process.returncode, out, err


def content(out: Path) -> dict[str, bytes]:
    """All files of an export but its lock, by path; the place of the export is left out of their contents."""
    files = {str(path.relative_to(out)): path for path in out.rglob("*") if path.is_file() and path.name != ".lock"}
    return {name: path.read_bytes().replace(str(out).encode(), b"OUT") for name, path in files.items()}


def test_a_cluster_finds_the_faults_that_this_machine_finds(dataset: Path, nodes: RayNodes, tmp_path: Path) -> None:
    damaged = Path(shutil.copytree(dataset, tmp_path / "set"))
    bag = damaged / "scenes/train/Blocks-0003/Blocks-0003_0.mcap"
    content = bytearray(bag.read_bytes())
    content[len(content) // 2] ^= 1
    bag.write_bytes(content)
    here, there = (finish(start("verify", damaged, "--json", *more)) for more in ((), ("--ray", nodes.address)))
    faults = json.loads(here[1])["faults"]
    assert any("CRC" in fault["problem"] and "Blocks-0003" in fault["bag"] for fault in faults)
    assert (there[0], json.loads(there[1])) == (here[0], json.loads(here[1])), there[2]


@pytest.mark.parametrize("wrong", [{"RAY_AUTH_TOKEN": "other"}, {"RAY_AUTH_TOKEN": "", "RAY_AUTH_TOKEN_PATH": "none"}])
def test_without_the_token_a_cluster_is_refused(
    dataset: Path, nodes: RayNodes, monkeypatch: pytest.MonkeyPatch, wrong: dict[str, str]
) -> None:
    for name, value in wrong.items():
        monkeypatch.setenv(name, value)
    code, _, err = finish(start("verify", dataset, "--ray", nodes.address))
    assert code == 2 and "RAY_AUTH_TOKEN" in err and "Traceback" not in err, err


@pytest.mark.parametrize("layout", EXPORTS)
def test_a_cluster_writes_the_bytes_that_this_machine_writes(
    dataset: Path, nodes: RayNodes, tmp_path: Path, layout: str
) -> None:
    for name, more in {"here": ("--workers", 2), "there": ("--ray", nodes.address)}.items():
        code, _, err = finish(start("export", layout, dataset, "--out", tmp_path / name, *more))
        assert code == 0, err
    here, there = content(tmp_path / "here"), content(tmp_path / "there")
    assert len(here) > SCENES and there.keys() == here.keys()
    assert [name for name in here if there[name] != here[name]] == []


def test_an_export_survives_an_interrupt_a_killed_process_and_a_dead_node(
    dataset: Path, nodes: RayNodes, tmp_path: Path
) -> None:
    here, there = tmp_path / "here", tmp_path / "there"
    assert finish(start("export", "simbev", dataset, "--out", here))[0] == 0
    arguments = ("export", "simbev", dataset, "--out", there, "--ray", nodes.address)

    def finished_parts() -> int:
        return len(list(there.glob("simbev/.parts/*.json")))

    interrupted = start(*arguments)
    wait_until(lambda: finished_parts() > 0)
    interrupted.send_signal(signal.SIGINT)
    code, _, err = finish(interrupted)
    before = finished_parts()
    assert code == 130 and not tasks(), err
    assert before < SCENES * TICKS // 20
    command = start(*arguments)
    wait_until(lambda: finished_parts() > before)
    wait_until(lambda: bool(tasks()))
    os.kill(tasks()[0], signal.SIGKILL)
    nodes.kill_raylet(0)
    code, _, err = finish(command)
    nodes.add()
    assert code == 0, err
    assert content(there) == content(here)
