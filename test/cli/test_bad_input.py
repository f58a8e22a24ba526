"""Bad input ends with exit code 2 and one clear message, before any process starts and without touching a file."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

pytestmark = pytest.mark.usefixtures("no_graph")


GOOD = """scenes: [{map: Blocks, train: 1}]
rig: {sensors: [{type: imu, name: imu}]}
traffic: {vehicles: 1, pedestrians: 1}
"""


def config(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "config.yaml"
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (GOOD + "speed: 3", "unknown key"),
        (GOOD + "time: {duration_s: 4 s}", "time.duration_s"),
        (GOOD.replace("vehicles: 1", "vehicles: -1"), "traffic.vehicles: is -1"),
        (GOOD.replace("Blocks", "Atlantis"), "scenes[0].map: no map is called 'Atlantis'; towns: "),
        (GOOD.replace("Blocks", "Block"), "yaml:1: scenes[0].map: no map is called 'Block'; did you mean Blocks?"),
        ("\0\1\2", "not valid YAML"),
        (
            GOOD + "agents: [{name: ego, rig: {sensors: []}}]",
            "config.yaml:4: agents[0].name: two agents are called ego",
        ),
        (
            GOOD + "agents: [{name: a, rig: {sensors: []}, blueprint: x}]",
            "config.yaml:4: agents[0].blueprint: no vehicle",
        ),
    ],
)
def test_bad_configuration(refused: Callable[..., str], tmp_path: Path, text: str, message: str) -> None:
    error = refused("run", config(tmp_path, text), "--record", tmp_path / "out")
    assert message in error
    assert not (tmp_path / "out").exists()


def test_missing_file(refused: Callable[..., str]) -> None:
    shipped = "baselines, cooperative, demo, live, paper, road, stack, teams"
    assert (
        refused("run", "nowhere.yaml") == f"error: nowhere.yaml: no such file; shipped configurations are {shipped}\n"
    )


def test_recording_never_overwrites(refused: Callable[..., str], tmp_path: Path) -> None:
    scene = tmp_path / "scenes/train/Blocks-0000"
    scene.mkdir(parents=True)
    (scene / "mine").write_text("precious")
    error = refused("run", config(tmp_path, GOOD), "--record", tmp_path)
    assert "exists already; nothing was overwritten" in error
    assert (scene / "mine").read_text() == "precious"


def test_output_below_a_file_is_refused(refused: Callable[..., str], tmp_path: Path) -> None:
    error = refused("run", config(tmp_path, GOOD), "--record", config(tmp_path, GOOD) / "x")
    assert "cannot be written to" in error


def test_demo_refuses_an_existing_folder(refused: Callable[..., str], tmp_path: Path) -> None:
    error = refused("demo", "--out", tmp_path)
    assert "exists already" in error


@pytest.mark.parametrize(
    "arguments", [("run",), ("fly",), ("run", "demo", "--fast"), ("run", "demo", "--domain", "999")]
)
def test_wrong_command_line(refused: Callable[..., str], arguments: tuple[str, ...]) -> None:
    refused(*arguments)


@pytest.mark.parametrize("verb", ["demo", "run", "info", "preview", "map", "doctor", "bench"])
def test_help_has_an_example(simbev: Callable[..., Any], verb: str) -> None:
    answer = simbev(verb, "--help")
    assert answer.code == 0
    usage, _, examples = answer.out.partition("Example")
    assert f"simbev {verb}" in usage
    assert f"simbev {verb}" in examples
