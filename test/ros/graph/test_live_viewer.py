"""The viewer of running graphs leaves them alone, whatever happens to it, and ends with the command that started it."""

import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import psutil
import pytest
from commands import SCENE, SMALL, Command, Config, Simbev, digests
from ros_domain import DOMAIN
from waiting import wait_until

pytest.importorskip("rerun", reason="Rerun is not installed: pip install -e .[view]")

pytestmark = pytest.mark.graph

DURATION_S = 3.0
"""The viewer shows the first frame about a second after the first tick."""


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Digests of the topics of a scene that was recorded without a viewer."""
    folder = tmp_path_factory.mktemp("undisturbed")
    (folder / "small.yaml").write_text(SMALL.replace("DURATION", f"{DURATION_S:g}"))
    code, output = Command("run", folder / "small.yaml", "--record", folder / "out").finish()
    assert code == 0, output
    return digests(folder / "out" / SCENE)


def await_line(command: Command, begin: str) -> str:
    """Read lines of a command's output up to one that begins so."""
    assert command.process.stdout is not None
    for line in command.process.stdout:
        if line.startswith(begin):
            return line.strip()
    raise AssertionError(f"no line begins with {begin!r}")


def viewers(command: Command) -> list[psutil.Process]:
    """The viewer beside a run, and Rerun's server."""
    found = psutil.Process(command.process.pid).children(recursive=True)
    return [each for each in found if {"view", "--serve-web"} & set(each.cmdline())]


@pytest.mark.slow
def test_a_stopped_viewer_neither_holds_up_a_graph_nor_changes_what_it_records(
    undisturbed: dict[str, str], simbev: Simbev, small_config: Config, tmp_path: Path
) -> None:
    viewer = simbev("view", "live", "--port", 0, "--no-open")
    assert await_line(viewer, "waiting") == f"waiting for a graph in domain {DOMAIN}; Ctrl-C ends"
    run = simbev("run", small_config(DURATION_S), "--record", tmp_path / "out")
    await_line(viewer, "showing Blocks-0000")
    assert run.process.poll() is None
    os.kill(viewer.process.pid, signal.SIGSTOP)
    code, output = run.finish()
    os.kill(viewer.process.pid, signal.SIGCONT)
    assert code == 0, output
    assert digests(tmp_path / "out" / SCENE) == undisturbed


@pytest.mark.slow
def test_a_graph_goes_on_when_its_viewer_is_killed(
    undisturbed: dict[str, str], simbev: Simbev, small_config: Config, tmp_path: Path
) -> None:
    run = simbev("run", small_config(DURATION_S), "--record", tmp_path / "out", "--view", "--view-port", 0)
    await_line(run, "viewer: http://127.0.0.1:")
    viewer, server = viewers(run)
    assert viewer.nice() == min(psutil.Process(run.process.pid).nice() + 10, 19)
    wait_until(lambda: "fastrtps" in Path(f"/proc/{viewer.pid}/maps").read_text())
    viewer.kill()
    code, output = run.finish()
    assert code == 0, output
    assert "the viewer has ended, killed by SIGKILL; the graph continues" in output
    assert digests(tmp_path / "out" / SCENE) == undisturbed
    wait_until(lambda: not server.is_running())


@pytest.mark.slow
def test_a_viewer_follows_one_graph_after_the_other(simbev: Simbev, small_config: Config, tmp_path: Path) -> None:
    viewer = simbev("view", "live", "--port", 0, "--no-open", "--rate", 20)
    for _ in range(2):
        await_line(viewer, "viewer: ") if _ == 0 else None
        run = simbev("run", small_config(DURATION_S))
        await_line(viewer, "showing Blocks-0000")
        assert run.finish()[0] == 0
        await_line(viewer, f"the graph has ended; waiting for a graph in domain {DOMAIN}")
    viewer.process.send_signal(signal.SIGINT)
    assert viewer.finish() == (130, "interrupted\n")


@pytest.mark.slow
def test_a_viewer_ends_with_the_run(simbev: Simbev, small_config: Config) -> None:
    run = simbev("run", small_config(600, without=["camera", "lidar", "radar"]), "--live", "--view", "--view-port", 0)
    await_line(run, "viewer: http://127.0.0.1:")
    processes = viewers(run)
    assert len(processes) == 2
    os.kill(processes[0].pid, signal.SIGSTOP)
    run.process.send_signal(signal.SIGINT)
    code, output = run.finish()
    assert (code, output.splitlines()[-1]) == (130, "interrupted")
    assert not any(each.is_running() for each in processes)


@pytest.mark.slow
def test_a_viewer_ends_when_the_run_is_killed(simbev: Simbev, small_config: Config) -> None:
    run = simbev("run", small_config(600), "--view", "--view-port", 0)
    await_line(run, "viewer: http://127.0.0.1:")
    processes = viewers(run)
    run.process.kill()
    wait_until(lambda: not any(each.is_running() for each in processes))
    code, output = simbev("run", small_config(0.5)).finish()  # removes what the killed one has left
    assert code == 0, output


def test_a_run_without_rerun_is_refused_before_the_graph_starts(small_config: Config, tmp_path: Path) -> None:
    program = "import sys; sys.modules['rerun'] = None; from simbev_ros.cli.main import main; main()"
    answer: Any = subprocess.run(
        [sys.executable, "-c", program, "run", small_config(), "--record", tmp_path / "out", "--view"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert answer.returncode == 2 and not (tmp_path / "out").exists()
    assert answer.stderr.startswith("error: simbev view needs Rerun; install it: ")
