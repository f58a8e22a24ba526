"""How the command line ends on request, or after an unexpected error."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from made_up_scene import made_up_scene
from waiting import PATIENCE_S, wait_until

from simbev_ros.assets import build_pool
from simbev_ros.assets.regions.static_cache import StaticCache
from simbev_ros.cli.main import main
from simbev_ros.maps.source import map_spec

STREETS = """<osm version="0.6"><node id="1" lat="50" lon="8"/><node id="2" lat="50" lon="8.02"/>
<node id="3" lat="50.004" lon="8.01"/><way id="1"><nd ref="1"/><nd ref="2"/><tag k="highway" v="residential"/></way>
<way id="2"><nd ref="1"/><nd ref="3"/><tag k="highway" v="residential"/></way></osm>"""
BUILDING = "surroundings/*/.*/"


@pytest.fixture
def streets(tmp_path: Path) -> Path:
    path = tmp_path / "streets.osm"
    path.write_text(STREETS)
    return path


@pytest.fixture
def building(tmp_path: Path, streets: Path) -> Iterator[subprocess.Popen[str]]:
    """The command, in a process group of its own, in the middle of the first regions."""
    command = [sys.executable, "-m", "simbev_ros.cli.main", "map", str(streets), "--all"]
    environment = {**os.environ, "XDG_CACHE_HOME": str(tmp_path)}
    with subprocess.Popen(
        command, env=environment, text=True, stderr=subprocess.PIPE, start_new_session=True
    ) as process:
        wait_until(lambda: any((tmp_path / "simbev_ros").glob(BUILDING)) or process.poll() is not None)
        assert process.poll() is None, "it was done too soon"
        yield process
        if _group_lives(process.pid):
            os.killpg(process.pid, signal.SIGKILL)


@pytest.mark.parametrize("number", [signal.SIGTERM, pytest.param(signal.SIGINT, marks=pytest.mark.slow)])
def test_an_interrupt_ends_all_processes_and_leaves_nothing(
    building: subprocess.Popen[str], tmp_path: Path, number: signal.Signals
) -> None:
    building.send_signal(number)
    _, error = building.communicate(timeout=PATIENCE_S)
    assert building.returncode == 130
    assert error.strip().endswith("interrupted")
    assert "leaked" not in error and "Traceback" not in error
    wait_until(lambda: not _group_lives(building.pid))
    assert not list((tmp_path / "simbev_ros").glob(BUILDING))


def test_workers_end_when_their_parent_is_killed(building: subprocess.Popen[str]) -> None:
    building.kill()
    building.wait()
    wait_until(lambda: not _group_lives(building.pid))


def test_a_fault_of_ours_is_said_with_what_it_happened_to(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path, streets: Path
) -> None:
    def fail(*_: object) -> None:
        raise ValueError("a negative area")

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(build_pool, "usable_cores", lambda: 1)
    monkeypatch.setattr(StaticCache, "region", fail)
    monkeypatch.setattr(sys, "argv", ["simbev", "map", str(streets)])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 1
    error = capsys.readouterr().err.strip()
    assert "error: this is a bug in simbev: ValueError: a negative area, while building region " in error
    assert f" of map {map_spec(str(streets)).path}\n" in error
    assert error.endswith("With SIMBEV_TRACEBACK=1 the traceback is shown")
    monkeypatch.setenv("SIMBEV_TRACEBACK", "1")
    with pytest.raises(ValueError, match="a negative area"):
        main()


def _group_lives(group: int) -> bool:
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return False
    return True


@pytest.mark.parametrize(("bag", "use"), [("Blocks-0000.partial", "repair"), ("Blocks-0000", "preview"), (None, "")])
def test_an_interrupted_demo_says_what_stays(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    bag: str | None,
    use: str,
) -> None:
    out = tmp_path / "out"

    def interrupt(*_: object, dataset: Path, **__: object) -> None:
        (dataset / "scenes/train").mkdir(parents=True)
        if bag is not None:
            made_up_scene(dataset / "scenes/train" / bag, ticks=1)
        signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr("simbev_ros.production.play.play_scenes", interrupt)
    monkeypatch.setattr(sys, "argv", ["simbev", "demo", "--out", str(out)])
    with pytest.raises(SystemExit, match="130"):
        main()
    path = f"{out}/scenes/train/{bag}"
    said = {"repair": "saves", "preview": "draws"}.get(use)
    lines = [f"{path} stays; simbev {use} {path} {said} what is in it"] if bag is not None else []
    assert capsys.readouterr().err.splitlines() == [*lines, "interrupted"]
    assert out.exists() == (bag is not None)
