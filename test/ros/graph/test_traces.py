"""A graph removes the traces of graphs that were killed, and of no others."""

import fcntl
import json
import os
import tempfile
from pathlib import Path

import psutil
import pytest

from simbev_ros.ros.graph.traces import Traces, sweep
from simbev_ros.ros.graph.traces import temporary_folder as new_temporary_folder


@pytest.fixture(autouse=True)
def temporary_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Let graphs leave their traces in a folder of the test."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    return tmp_path


def write_traces(folder: Path, **record: object) -> Path:
    """Write the record of a graph without files in shared memory; return its folder."""
    graph = folder / "simbev_ros-other"
    graph.mkdir()
    (graph / "traces.json").write_text(json.dumps({"files": [], **record}))
    return graph


def test_traces_of_a_running_graph_stay_until_it_removes_them() -> None:
    traces = Traces()
    sweep()
    assert traces.folder.is_dir()
    traces.remove(keep_logs=False)
    assert not traces.folder.exists()


def test_files_of_a_process_that_never_mapped_them_are_removed_once_nobody_locks_them() -> None:
    traces = Traces()
    names = [f"fastrtps_test_{os.getpid()}_{kind}" for kind in ("locked", "left")]
    files = [Path(f"/dev/shm/{name}{ending}") for name in names for ending in ("", "_el")]
    for file in files:
        file.touch()
    with files[1].open("rb") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        traces.remove(keep_logs=False)
        assert [file.exists() for file in files] == [True, True, False, False]
    for file in files[:2]:
        file.unlink()


def test_a_temporary_folder_stays_while_its_process_lives_and_goes_when_it_is_dead(
    temporary_folder: Path,
) -> None:
    folder = new_temporary_folder()
    (folder / "worker-1").mkdir()
    sweep()
    assert (folder / "worker-1").is_dir()
    record = json.loads((folder / "traces.json").read_text())
    (folder / "traces.json").write_text(json.dumps({**record, "pid": max(psutil.pids()) + 1000}))
    sweep()
    assert not folder.exists()


def test_traces_of_an_ended_process_are_removed(temporary_folder: Path) -> None:
    free_pid = max(psutil.pids()) + 1000
    graph = write_traces(temporary_folder, pid=free_pid, started_s=psutil.boot_time())
    sweep()
    assert not graph.exists()


def test_another_process_with_a_reused_pid_does_not_keep_traces(temporary_folder: Path) -> None:
    graph = write_traces(temporary_folder, pid=os.getpid(), started_s=psutil.Process().create_time() - 3600)
    sweep()
    assert not graph.exists()


def test_a_record_without_start_time_is_kept_while_its_pid_exists(temporary_folder: Path) -> None:
    graph = write_traces(temporary_folder, pid=os.getpid())
    sweep()
    assert graph.is_dir()


def test_records_that_cannot_be_read_are_left_alone(temporary_folder: Path) -> None:
    graph = write_traces(temporary_folder, pid="?")
    sweep()
    assert graph.is_dir()


def test_folders_that_others_may_write_to_and_links_are_left_alone(temporary_folder: Path, tmp_path: Path) -> None:
    free_pid = max(psutil.pids()) + 1000
    shared = write_traces(temporary_folder, pid=free_pid)
    shared.chmod(0o777)
    (elsewhere := tmp_path / "elsewhere").mkdir()
    linked = write_traces(elsewhere, pid=free_pid)
    (temporary_folder / "simbev_ros-link").symlink_to(linked)
    sweep()
    assert (shared / "traces.json").exists() and (linked / "traces.json").exists()


def test_a_record_removes_no_files_but_those_of_the_middleware(temporary_folder: Path, tmp_path: Path) -> None:
    (precious := tmp_path / "precious").write_text("mine")
    write_traces(temporary_folder, pid=max(psutil.pids()) + 1000, files=[str(precious)])
    sweep()
    assert precious.read_text() == "mine"
