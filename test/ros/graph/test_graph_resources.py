"""A graph removes the resources of graphs that were killed, and of no others."""

import fcntl
import json
import os
import tempfile
from pathlib import Path

import psutil
import pytest

from simbev_ros.ros.graph.resources import GraphResources, reap_killed_graphs
from simbev_ros.ros.graph.resources import temporary_folder as new_temporary_folder


@pytest.fixture(autouse=True)
def temporary_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Let graphs leave their resources in a folder of the test."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    return tmp_path


def write_record(folder: Path, **record: object) -> Path:
    """Write the record of a graph without files in shared memory; return its folder."""
    graph = folder / "simbev_ros-other"
    graph.mkdir()
    (graph / "resources.json").write_text(json.dumps({"files": [], "started_s": 0.0, **record}))
    return graph


def test_resources_of_a_running_graph_stay_until_it_removes_them() -> None:
    resources = GraphResources()
    reap_killed_graphs()
    assert resources.folder.is_dir()
    resources.remove(keep_logs=False)
    assert not resources.folder.exists()


def test_files_of_a_process_that_never_mapped_them_are_removed_once_nobody_locks_them() -> None:
    resources = GraphResources()
    names = [f"fastrtps_test_{os.getpid()}_{kind}" for kind in ("locked", "left")]
    files = [Path(f"/dev/shm/{name}{ending}") for name in names for ending in ("", "_el")]
    for file in files:
        file.touch()
    with files[1].open("rb") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        resources.remove(keep_logs=False)
        assert [file.exists() for file in files] == [True, True, False, False]
    for file in files[:2]:
        file.unlink()


def test_a_temporary_folder_stays_while_its_process_lives_and_goes_when_it_is_dead(
    temporary_folder: Path,
) -> None:
    folder = new_temporary_folder()
    (folder / "worker-1").mkdir()
    reap_killed_graphs()
    assert (folder / "worker-1").is_dir()
    record = json.loads((folder / "resources.json").read_text())
    (folder / "resources.json").write_text(json.dumps({**record, "pid": max(psutil.pids()) + 1000}))
    reap_killed_graphs()
    assert not folder.exists()


def test_resources_of_an_ended_process_are_removed(temporary_folder: Path) -> None:
    free_pid = max(psutil.pids()) + 1000
    graph = write_record(temporary_folder, pid=free_pid, started_s=psutil.boot_time())
    reap_killed_graphs()
    assert not graph.exists()


def test_another_process_with_a_reused_pid_does_not_keep_resources(temporary_folder: Path) -> None:
    graph = write_record(temporary_folder, pid=os.getpid(), started_s=psutil.Process().create_time() - 3600)
    reap_killed_graphs()
    assert not graph.exists()


def test_records_that_cannot_be_read_are_left_alone(temporary_folder: Path) -> None:
    graph = write_record(temporary_folder, pid="?")
    reap_killed_graphs()
    assert graph.is_dir()


def test_folders_that_others_may_write_to_and_links_are_left_alone(temporary_folder: Path, tmp_path: Path) -> None:
    free_pid = max(psutil.pids()) + 1000
    shared = write_record(temporary_folder, pid=free_pid)
    shared.chmod(0o777)
    (elsewhere := tmp_path / "elsewhere").mkdir()
    linked = write_record(elsewhere, pid=free_pid)
    (temporary_folder / "simbev_ros-link").symlink_to(linked)
    reap_killed_graphs()
    assert (shared / "resources.json").exists() and (linked / "resources.json").exists()


def test_a_record_removes_no_files_but_those_of_the_middleware(temporary_folder: Path, tmp_path: Path) -> None:
    (precious := tmp_path / "precious").write_text("mine")
    write_record(temporary_folder, pid=max(psutil.pids()) + 1000, files=[str(precious)])
    reap_killed_graphs()
    assert precious.read_text() == "mine"
